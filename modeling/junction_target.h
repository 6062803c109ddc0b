// The surface a junction keeps to: a smooth union of its branches, as an implicit function.
#pragma once

#include <vector>

#include "base/vector.h"

namespace angiospline {

// A branch from the origin: the ray capsule of this unit direction and radius.
struct TargetBranch {
  Vec3 direction = Vec3::Zero();
  double radius = 0.0;
};

// S: sum_i exp(-delta_i / k_i) = 1, delta_i the signed distance to branch i's capsule and
// k_i = blend r_i sqrt(1 + growth^2 |x|^2 / r_i^2). S is star-shaped about the origin, contains
// every capsule and leaves them as the distance to the other branches grows.
class JunctionTarget {
 public:
  JunctionTarget(std::vector<TargetBranch> branches, double blend, double growth);

  const std::vector<TargetBranch>& branches() const { return branches_; }

  // -log of the sum and its gradient: negative inside, zero on S.
  struct Value {
    double value;
    Vec3 gradient;
  };
  Value at(const Vec3& x) const;

  // First-order foot of x on S: the signed distance and the unit outward normal there.
  struct Foot {
    double distance;
    Vec3 normal;
  };
  Foot foot(const Vec3& x) const;

  // The point of S on the ray from the origin along w, at most `longest` away. Newton's method from
  // inside on a function that grows along the ray.
  Vec3 on_ray(const Vec3& w, double longest) const;

  // The other branches' share sum_{j != i} exp(-delta_j / k_j) at x.
  double others_share(int i, const Vec3& x) const;

  // Signed distance to the union of the capsules.
  double union_distance(const Vec3& x) const;

 private:
  double exponent(std::size_t i, const Vec3& x, Vec3* gradient) const;

  std::vector<TargetBranch> branches_;
  double blend_;
  double growth_squared_;
};

}  // namespace angiospline
