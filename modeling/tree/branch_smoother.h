// One branch from jagged points and radii to one smooth path; smooth_centerlines puts them
// together.
#pragma once

#include <memory>

#include <Eigen/Core>

#include "kernel/fit/penalised_spline.h"
#include "kernel/spline/curve.h"
#include "modeling/tree/centerline_tree.h"

namespace angiospline {

struct BranchSmootherOptions {
  double largest_move = 0.5;  // in local radii
  double largest_bend = 0.8;  // curvature times radius above which a body comes close to folding
  double path_tolerance = 0.004;  // of the final path against the smoothing spline, in radii
};

// What came of it: the path and how well it kept the rules.
struct SmoothPath {
  BSplineCurve<4> path;
  double largest_move_mm = 0.0;
  double largest_move_radii = 0.0;
  double sharpest_bend = 0.0;      // largest curvature times radius, away from the junctions
  double radius_reduced_to = 1.0;  // least factor on the radius in bends too sharp for it
};

// One end of a branch, as its tree knows it.
struct SmootherEnd {
  bool is_junction = false;  // then the radius of the end's point may be the parent's
  double hidden_mm = 0.0;    // so far from the end the branch lies inside its junction
};

// Strengths of smoothing are tried on one grid for all branches, as powers of ten of a strength
// that is the same for trees of any scale: exponent k is kFirstStrength + k * kStrengthStep.
inline constexpr double kFirstStrength = -6.0;
inline constexpr double kStrengthStep = 0.5;
inline constexpr int kStrengthCount = 33;

// Holds the sampled branch between the steps: criteria of the strengths, choice, ends, path.
class BranchSmoother {
 public:
  // `tree_radius_mm`: a typical radius of the whole tree, against which noise is measured.
  // Requires at least two points, positive length and radii.
  BranchSmoother(const CenterlineBranch& branch, const SmootherEnd& start, const SmootherEnd& end,
                 double tree_radius_mm, const BranchSmootherOptions& options);
  ~BranchSmoother();
  BranchSmoother(BranchSmoother&&) noexcept;
  BranchSmoother& operator=(BranchSmoother&&) noexcept;

  // The restricted likelihood's verdict on every strength of the grid, for points and radii.
  const Eigen::VectorXd& position_criteria() const;
  const Eigen::VectorXd& radius_criteria() const;

  // Takes this branch's best strengths, drawn towards the grid positions that suit the tree as a
  // whole: short branches have too few points to tell noise from shape by themselves.
  void choose_strengths(double position_of_tree, double radius_of_tree);

  // What the branch's points and stiffness say about its two ends (after choose_strengths).
  CondensedEnds condensed_ends() const;

  // The path from `start` to `end` exactly (after choose_strengths).
  SmoothPath smooth(const Vec3& start, const Vec3& end) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// The (fractional) grid position with the least criterion.
double best_grid_position(const Eigen::VectorXd& criteria);

}  // namespace angiospline
