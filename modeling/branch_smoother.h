// One branch from jagged points and radii to one smooth path; smooth_centerlines puts them
// together.
#pragma once

#include <memory>
#include <utility>

#include <Eigen/Core>

#include "kernel/curve.h"
#include "modeling/centerline_tree.h"

namespace angiospline {

struct BranchSmootherOptions {
  double largest_move = 0.5;  // in local radii
  double largest_bend = 0.8;  // curvature times radius above which a body comes close to folding
  double path_tolerance = 0.002;  // of the final path against the smoothing spline, in radii
};

// What came of it: the path and how well it kept the rules.
struct SmoothPath {
  BSplineCurve<4> path;
  double largest_move_mm = 0.0;
  double largest_move_radii = 0.0;
  double sharpest_bend = 0.0;  // largest curvature times radius of the path
};

// Holds the sampled branch between the passes: free ends first (to place the nodes), fixed ends
// then.
class BranchSmoother {
 public:
  // `trust_start`, `trust_end`: whether the radius of that end's point belongs to this branch; at a
  // junction it often is the parent's. Requires at least two points, positive length and radii.
  BranchSmoother(const CenterlineBranch& branch, bool trust_start, bool trust_end,
                 const BranchSmootherOptions& options);
  ~BranchSmoother();
  BranchSmoother(BranchSmoother&&) noexcept;
  BranchSmoother& operator=(BranchSmoother&&) noexcept;

  // Where the branch alone would put its ends, and its radii there.
  std::pair<Vec3, Vec3> free_ends() const;
  std::pair<double, double> end_radii_mm() const;

  // The path from `start` to `end` exactly.
  SmoothPath smooth(const Vec3& start, const Vec3& end) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace angiospline
