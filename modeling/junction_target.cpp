#include "modeling/junction_target.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Geometry>

namespace angiospline {
namespace {

// Terms this far below the largest are lost to rounding in the sum.
constexpr double kNegligible = 38.0;

double capsule_distance(const TargetBranch& branch, const Vec3& x, Vec3* gradient) {
  const double along = std::max(0.0, branch.direction.dot(x));
  const Vec3 away = x - along * branch.direction;
  const double length = away.norm();
  if (gradient != nullptr) {
    *gradient = length > 0 ? Vec3(away / length) : Vec3(branch.direction.unitOrthogonal());
  }
  return length - branch.radius;
}

}  // namespace

JunctionTarget::JunctionTarget(std::vector<TargetBranch> branches, double blend, double growth)
    : branches_(std::move(branches)), blend_(blend), growth_squared_(growth * growth) {}

double JunctionTarget::exponent(std::size_t i, const Vec3& x, Vec3* gradient) const {
  const TargetBranch& branch = branches_[i];
  const double delta = capsule_distance(branch, x, gradient);
  const double r = branch.radius;
  const double reach = std::sqrt(r * r + growth_squared_ * x.squaredNorm());
  const double width = blend_ * reach;
  if (gradient != nullptr) {
    const double grows = growth_squared_ * delta / (width * reach * reach);
    *gradient = *gradient / width - grows * x;
  }
  return delta / width;
}

JunctionTarget::Value JunctionTarget::at(const Vec3& x) const {
  double least = std::numeric_limits<double>::infinity();
  double sum = 0;
  Vec3 gradient_sum = Vec3::Zero();
  for (std::size_t i = 0; i < branches_.size(); ++i) {
    Vec3 gradient;
    const double e = exponent(i, x, &gradient);
    if (e - least > kNegligible) continue;
    if (e < least) {  // rescale to the new largest term
      const double scale = std::isinf(least) ? 0.0 : std::exp(e - least);
      sum = sum * scale + 1;
      gradient_sum = gradient_sum * scale + gradient;
      least = e;
    } else {
      const double term = std::exp(least - e);
      sum += term;
      gradient_sum += term * gradient;
    }
  }
  return {least - std::log(sum), gradient_sum / sum};
}

JunctionTarget::Foot JunctionTarget::foot(const Vec3& x) const {
  const Value v = at(x);
  const double slope = v.gradient.norm();
  return {v.value / slope, v.gradient / slope};
}

Vec3 JunctionTarget::on_ray(const Vec3& w, double longest) const {
  // Start on the union of the capsules, which S contains.
  double t = 0;
  for (const TargetBranch& branch : branches_) {
    const double along = branch.direction.dot(w);
    const double sine = std::sqrt(std::max(0.0, 1 - along * along));
    const double reach = along <= 0                       ? branch.radius
                         : sine * longest > branch.radius ? branch.radius / sine
                                                          : longest;
    t = std::max(t, reach);
  }
  for (int step = 0; step < 30 && t < longest; ++step) {
    const Value v = at(t * w);
    const double slope = v.gradient.dot(w);
    if (!(slope > 0)) break;
    const double move = -v.value / slope;
    t += std::clamp(move, -0.2 * t, 0.2 * t);
    if (std::abs(move) < 1e-10 * t) break;
  }
  return std::min(t, longest) * w;
}

double JunctionTarget::others_share(int i, const Vec3& x) const {
  double sum = 0;
  for (std::size_t j = 0; j < branches_.size(); ++j) {
    if (static_cast<int>(j) != i) sum += std::exp(-exponent(j, x, nullptr));
  }
  return sum;
}

double JunctionTarget::union_distance(const Vec3& x) const {
  double least = std::numeric_limits<double>::infinity();
  for (const TargetBranch& branch : branches_) {
    least = std::min(least, capsule_distance(branch, x, nullptr));
  }
  return least;
}

}  // namespace angiospline
