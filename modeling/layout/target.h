// The surface a junction keeps to: a smooth union of its branches, as an
// implicit function.
#pragma once

#include <vector>

#include "base/vector.h"

namespace angiospline {

// The ray capsule of this start, unit direction and radius; of a segment if it
// has a length.
struct TargetBranch {
  Vec3 direction = Vec3::Zero();
  double radius = 0.0;
  Vec3 start = Vec3::Zero();
  double length = 0.0;  // 0: a ray
};

// S is where a smooth union of the signed distances delta_i vanishes. With w_i
// = exp(-delta_i / k),
//   sum_i w_i^2 / sum_j c_ij w_j = 1.
// c_ij in [0, 1] says how far the gradients of delta_i and delta_j agree, c_ii
// = 1: where they are opposed this is the usual blend sum_i w_i = 1, where they
// agree (the two halves of a straight trunk) nothing is added and S is the
// cylinder itself. k is the mean of the pairs' widths weighted by w and by
// disagreement: blend * min(r_i, r_j), or what rounds the crotch of an acute
// pair to a stated curvature. S leaves the capsules as the distance to the
// other branches grows.
class JunctionTarget {
 public:
  // Requires 1 to 24 rays. A ray that does not start in the origin gets a core:
  // a segment from the origin to its start, shared by rays that start together.
  JunctionTarget(std::vector<TargetBranch> branches, double blend, double rounding);

  // The rays, then the cores.
  const std::vector<TargetBranch>& branches() const { return branches_; }

  // -log of the left-hand side and its gradient: negative inside, zero on S.
  struct Value {
    double value;
    Vec3 gradient;
  };
  Value at(const Vec3& x) const;

  // First-order foot of x on S: the signed distance and the unit outward normal
  // there.
  struct Foot {
    double distance;
    Vec3 normal;
  };
  Foot foot(const Vec3& x) const;

  // The point of S on the ray from the origin along w, at most `longest` away;
  // with cores, the outermost. Newton's method from inside on a function that
  // grows along the ray; with cores, steps of the distance from outside.
  Vec3 on_ray(const Vec3& w, double longest) const;

  // The other branches' share at x: sum_{j != i} w_j (1 - c_ij), j not i's own
  // core.
  double others_share(int i, const Vec3& x) const;

  // Signed distance to the union of the capsules.
  double union_distance(const Vec3& x) const;

 private:
  void add_cores();
  Vec3 outermost_on_ray(const Vec3& w, double longest) const;
  struct Near;
  void find_near(const Vec3& x, Near& near) const;
  Vec3 gradient(const Near& near, const double* on_distance, const double* on_agreement) const;
  double width(const Near& near, double per_k, double* on_distance, double* on_agreement) const;

  std::vector<TargetBranch> branches_;
  std::size_t rays_ = 0;
  std::vector<std::size_t> core_of_;  // each ray's core, or its own number
  Eigen::MatrixXd widths_;            // k of each pair
  std::vector<double> widest_;        // of each branch's pairs
};

}  // namespace angiospline
