#include "modeling/junction_target.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>

#include "base/contract.h"

namespace angiospline {
namespace {

// Branches whose distance exceeds the least one by this many widths are lost in the sum.
constexpr double kNegligible = 25.0;
// The ray's start is rounded over this part of the radius, so that gradients have no kinks.
constexpr double kRoundedStart = 0.25;
// Pairs at this angle or less have the rounding asked for, at kWide or more 1 + kRounder times it.
constexpr double kAcute = 30 * std::numbers::pi / 180;
constexpr double kWide = 50 * std::numbers::pi / 180;
constexpr double kRounder = 0.8;
// The crotch fills up by log 2 times the width: this leaves it within half a radius of the
// cylinders.
constexpr double kWidest = 0.6;
constexpr std::size_t kMostActive = 24;  // branches of one target

// A number and its gradient in space.
struct Dual {
  double v = 0;
  Vec3 d = Vec3::Zero();
};
Dual operator+(const Dual& a, const Dual& b) { return {a.v + b.v, a.d + b.d}; }
Dual operator*(const Dual& a, const Dual& b) { return {a.v * b.v, a.v * b.d + b.v * a.d}; }
Dual operator*(double a, const Dual& b) { return {a * b.v, a * b.d}; }
Dual operator/(const Dual& a, const Dual& b) {
  const double q = a.v / b.v;
  return {q, (a.d - q * b.d) / b.v};
}
Dual exp(const Dual& a) {
  const double e = std::exp(a.v);
  return {e, e * a.d};
}

// Distance to a ray capsule, its gradient, and the gradient's derivative (symmetric).
struct Distance {
  double value;
  Vec3 gradient;
  Mat3 hessian;
};

Distance capsule(const TargetBranch& branch, const Vec3& x) {
  const Vec3& d = branch.direction;
  const double y = d.dot(x);
  const double e = kRoundedStart * branch.radius;
  const double root = std::sqrt(y * y + e * e);
  const double along = (y + root) / 2;  // max(0, y), rounded
  const double slope = along / root;
  const double bend = e * e / (2 * root * root * root);
  const Vec3 away = x - along * d;
  const double length = std::max(away.norm(), 1e-9 * branch.radius);
  const double off = d.dot(away);  // y - along <= 0
  // length^2 = x.x - 2 along y + along^2.
  const Vec3 half = away - slope * off * d;
  const Mat3 half_slope =
      Mat3::Identity() + (-2 * slope - bend * off + slope * slope) * d * d.transpose();
  const Vec3 gradient = half / length;
  return {length - branch.radius, gradient,
          (half_slope - gradient * gradient.transpose()) / length};
}

double capsule_value(const TargetBranch& branch, const Vec3& x) {
  const double y = branch.direction.dot(x);
  const double e = kRoundedStart * branch.radius;
  const double along = (y + std::sqrt(y * y + e * e)) / 2;
  return (x - along * branch.direction).norm() - branch.radius;
}

// 0 for gradients a right angle apart or more, 1 for equal ones.
Dual agreement(const Distance& a, const Distance& b) {
  const double t = a.gradient.dot(b.gradient);
  if (t <= 0) return {};
  return {t * t, 2 * t * (a.hessian * b.gradient + b.hessian * a.gradient)};
}

}  // namespace

JunctionTarget::JunctionTarget(std::vector<TargetBranch> branches, double blend, double rounding)
    : branches_(std::move(branches)) {
  EXPECTS(!branches_.empty() && branches_.size() <= kMostActive);
  const Eigen::Index n = static_cast<Eigen::Index>(branches_.size());
  widths_.resize(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      const TargetBranch& a = branches_[static_cast<std::size_t>(i)];
      const TargetBranch& b = branches_[static_cast<std::size_t>(j)];
      const double r = std::min(a.radius, b.radius);
      widths_(i, j) = blend * r;
      if (i == j) continue;
      // A crotch of half angle h has curvature cos^2 h / (k sin h).
      const double half = std::acos(std::clamp(a.direction.dot(b.direction), -1.0, 1.0)) / 2;
      const double cosine = std::cos(half);
      // Wide pairs have the room for a rounder one.
      const double wide = std::clamp((2 * half - kAcute) / (kWide - kAcute), 0.0, 1.0);
      const double radius = (1 + kRounder * wide) * rounding * r;
      const double width = std::min(radius * cosine * cosine / std::sin(half), kWidest * r);
      widths_(i, j) = std::max(blend * r, width);
    }
  }
}

JunctionTarget::Value JunctionTarget::at(const Vec3& x) const {
  // Distances of all, then derivatives of those that count.
  double least = std::numeric_limits<double>::infinity();
  std::array<double, kMostActive> value{};
  const std::size_t n = branches_.size();
  for (std::size_t i = 0; i < n; ++i) {
    value[i] = capsule_value(branches_[i], x);
    least = std::min(least, value[i]);
  }
  std::array<std::size_t, kMostActive> active{};
  std::array<Distance, kMostActive> distance;
  std::size_t count = 0;
  for (std::size_t i = 0; i < n; ++i) {
    if (value[i] - least > kNegligible * widths_.row(static_cast<Eigen::Index>(i)).maxCoeff())
      continue;
    active[count] = i;
    distance[count++] = capsule(branches_[i], x);
  }
  if (count == 1) {
    const double k =
        widths_(static_cast<Eigen::Index>(active[0]), static_cast<Eigen::Index>(active[0]));
    return {distance[0].value / k, distance[0].gradient / k};
  }
  // The pairs' agreement and the width k.
  std::array<std::array<Dual, kMostActive>, kMostActive> c;
  Dual top, bottom;
  for (std::size_t a = 0; a < count; ++a) {
    c[a][a].v = 1;
    for (std::size_t b = a + 1; b < count; ++b) {
      c[a][b] = c[b][a] = agreement(distance[a], distance[b]);
      const auto i = static_cast<Eigen::Index>(active[a]);
      const auto j = static_cast<Eigen::Index>(active[b]);
      const double k = widths_(i, j);
      // Nearness of x to both, over a width that does not depend on the pair's own.
      const double reach = std::min(branches_[active[a]].radius, branches_[active[b]].radius);
      const Dual apart{(distance[a].value + distance[b].value) / reach,
                       (distance[a].gradient + distance[b].gradient) / reach};
      const Dual near = exp(-1.0 * apart);
      const Dual weight = near * (Dual{1.02, Vec3::Zero()} + -1.0 * c[a][b]);
      top = top + k * weight;
      bottom = bottom + weight;
    }
  }
  if (!(bottom.v > 1e-290)) return {least / widths_(0, 0), distance[0].gradient / widths_(0, 0)};
  const Dual k = top / bottom;
  std::array<Dual, kMostActive> w;
  for (std::size_t a = 0; a < count; ++a) {
    w[a] = exp(Dual{-(distance[a].value - least), -distance[a].gradient} / k);
  }
  Dual sum;
  for (std::size_t a = 0; a < count; ++a) {
    Dual mixed;
    for (std::size_t b = 0; b < count; ++b) mixed = mixed + c[a][b] * w[b];
    if (w[a].v > 0) sum = sum + w[a] * w[a] / mixed;
  }
  // -log(sum exp(-least / k)), with `least` held while the terms were scaled.
  const Dual lifted = Dual{least, Vec3::Zero()} / k;
  return {lifted.v - std::log(sum.v), lifted.d - sum.d / sum.v};
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
  const auto own = static_cast<std::size_t>(i);
  const Distance mine = capsule(branches_[own], x);
  double sum = 0;
  for (std::size_t j = 0; j < branches_.size(); ++j) {
    if (j == own) continue;
    const Distance other = capsule(branches_[j], x);
    const double k = widths_(i, static_cast<Eigen::Index>(j));
    sum += std::exp(-other.value / k) * (1.01 - agreement(mine, other).v);
  }
  return sum;
}

double JunctionTarget::union_distance(const Vec3& x) const {
  double least = std::numeric_limits<double>::infinity();
  for (const TargetBranch& branch : branches_) least = std::min(least, capsule_value(branch, x));
  return least;
}

}  // namespace angiospline
