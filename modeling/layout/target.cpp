#include "modeling/layout/target.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include <Eigen/Geometry>

#include "base/contract.h"
#include "modeling/layout/rules.h"

namespace angiospline {
namespace {

using namespace layout_rules;

constexpr std::size_t kMostActive = 2 * kMostRays;  // with a core for each

// Distance to a ray capsule and its gradient. Its second derivative is
// (I + bend d d' - gradient gradient') / length, d the branch's direction.
struct Distance {
  double value;
  Vec3 gradient;
  double bend;
  double per_length;
};

// max(0, y), rounded over e, with its derivatives.
struct Ramp {
  double value, slope, bend;
};
Ramp ramp(double y, double e) {
  const double root = std::sqrt(y * y + e * e);
  const double value = (y + root) / 2;
  return {value, value / root, e * e / (2 * root * root * root)};
}

Distance capsule(const TargetBranch& branch, const Vec3& place) {
  const Vec3 x = place - branch.start;
  const Vec3& d = branch.direction;
  const double y = d.dot(x);
  const double e = kRoundedStart * branch.radius;
  auto [along, slope, bend] = ramp(y, e);

  if (branch.length > 0) {
    const Ramp beyond = ramp(y - branch.length, e);
    along -= beyond.value;
    slope -= beyond.slope;
    bend -= beyond.bend;
  }

  const Vec3 away = x - along * d;
  const double length = std::max(away.norm(), 1e-9 * branch.radius);
  const double off = d.dot(away);  // y - along <= 0
  // length^2 = x.x - 2 along y + along^2.
  return {length - branch.radius, (away - slope * off * d) / length,
          -2 * slope - bend * off + slope * slope, 1 / length};
}

double capsule_value(const TargetBranch& branch, const Vec3& place) {
  const Vec3 x = place - branch.start;
  const double y = branch.direction.dot(x);
  const double e = kRoundedStart * branch.radius;
  double along = ramp(y, e).value;
  if (branch.length > 0) along -= ramp(y - branch.length, e).value;
  return (x - along * branch.direction).norm() - branch.radius;
}

// 0 for gradients a right angle apart or more, 1 for equal ones.
double agreement(const Distance& a, const Distance& b) {
  const double t = a.gradient.dot(b.gradient);
  return t <= 0 ? 0.0 : t * t;
}

// The gradient of agreement(a, b), which is positive.
Vec3 agreement_gradient(const Distance& a, const Vec3& direction_a, const Distance& b,
                        const Vec3& direction_b) {
  const double t = a.gradient.dot(b.gradient);
  const Vec3 by_a =
      b.gradient + (a.bend * direction_a.dot(b.gradient)) * direction_a - t * a.gradient;
  const Vec3 by_b =
      a.gradient + (b.bend * direction_b.dot(a.gradient)) * direction_b - t * b.gradient;
  return 2 * t * (a.per_length * by_a + b.per_length * by_b);
}

// Row-major square of the first `count` branches, uninitialised: most points
// have two or three.
using Square = std::array<double, kMostActive * kMostActive>;

}  // namespace

JunctionTarget::JunctionTarget(std::vector<TargetBranch> branches, double blend, double rounding)
    : branches_(std::move(branches)) {
  EXPECTS(!branches_.empty() && branches_.size() <= kMostRays);

  rays_ = branches_.size();
  double smallest = branches_.front().radius;
  for (const TargetBranch& ray : branches_) smallest = std::min(smallest, ray.radius);
  add_cores();

  // The width of each pair: how far its crotch is filled.
  const Eigen::Index n = static_cast<Eigen::Index>(branches_.size());
  widths_.resize(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      const TargetBranch& a = branches_[static_cast<std::size_t>(i)];
      const TargetBranch& b = branches_[static_cast<std::size_t>(j)];
      const double r = std::min(a.radius, b.radius);
      widths_(i, j) = blend * r;

      // A core and what leaves it make no crotch of their own.
      if (i == j || a.length > 0 || b.length > 0) continue;

      // A crotch of half angle h has curvature cos^2 h / (k sin h).
      const double half = std::acos(std::clamp(a.direction.dot(b.direction), -1.0, 1.0)) / 2;
      const double cosine = std::cos(half);

      // Wide pairs have the room for a rounder one.
      const double wide = std::clamp((2 * half - kAcute) / (kWide - kAcute), 0.0, 1.0);
      const double radius = (1 + kRounder * wide) * rounding * r;
      const double width = std::max(blend * r, radius * cosine * cosine / std::sin(half));
      widths_(i, j) = std::min(width, std::max(kWidest * smallest, kNarrow * r));
    }
    widest_.push_back(widths_.row(i).maxCoeff());
  }
}

void JunctionTarget::add_cores() {
  for (std::size_t i = 0; i < rays_; ++i) {
    core_of_.push_back(i);
    const TargetBranch ray = branches_[i];
    const double length = ray.start.norm();
    if (!(length > kSameStart * ray.radius)) continue;

    // Rays that start together share a core.
    std::size_t core = rays_;
    while (core < branches_.size() &&
           (branches_[core].length * branches_[core].direction - ray.start).norm() >
               kSameStart * ray.radius) {
      ++core;
    }

    core_of_[i] = core;
    if (core == branches_.size()) {
      branches_.push_back({ray.start / length, ray.radius, Vec3::Zero(), length});
    }
    branches_[core].radius = std::max(branches_[core].radius, ray.radius);
  }
}

// The branches near a point; the arrays are filled up to `count`.
struct JunctionTarget::Near {
  std::size_t count = 0;
  double least = 0;  // of all distances
  std::array<std::size_t, kMostActive> branch;
  std::array<Distance, kMostActive> distance;
  Square agreement;
};

void JunctionTarget::find_near(const Vec3& x, Near& near) const {
  // Distances of all, then derivatives of those that count.
  near.least = std::numeric_limits<double>::infinity();
  std::array<double, kMostActive> value;
  const std::size_t n = branches_.size();
  for (std::size_t i = 0; i < n; ++i) {
    value[i] = capsule_value(branches_[i], x);
    near.least = std::min(near.least, value[i]);
  }

  near.count = 0;
  for (std::size_t i = 0; i < n; ++i) {
    if (value[i] - near.least > kNegligible * widest_[i]) continue;
    near.branch[near.count] = i;
    near.distance[near.count++] = capsule(branches_[i], x);
  }

  for (std::size_t a = 0; a < near.count; ++a) {
    for (std::size_t b = a + 1; b < near.count; ++b) {
      near.agreement[a * near.count + b] = near.agreement[b * near.count + a] =
          agreement(near.distance[a], near.distance[b]);
    }
    near.agreement[a * near.count + a] = 1;
  }
}

// The width k at a point; adds `per_k` times its derivatives to those of the
// distances (on_distance) and of the agreements (on_agreement, upper triangle)
// when it is called with a factor.
double JunctionTarget::width(const Near& near, double per_k, double* on_distance,
                             double* on_agreement) const {
  const std::size_t m = near.count;
  const auto pair_width = [&](std::size_t a, std::size_t b) {
    return widths_(static_cast<Eigen::Index>(near.branch[a]),
                   static_cast<Eigen::Index>(near.branch[b]));
  };
  if (m == 2) return pair_width(0, 1);

  Square weight;
  double top = 0, bottom = 0;
  for (std::size_t a = 0; a < m; ++a) {
    for (std::size_t b = a + 1; b < m; ++b) {
      // Nearness to both, over a width that does not depend on the pair's own.
      const double reach =
          std::min(branches_[near.branch[a]].radius, branches_[near.branch[b]].radius);
      const double e = std::exp(-(near.distance[a].value + near.distance[b].value) / reach);
      weight[a * m + b] = e * (kDisagreement - near.agreement[a * m + b]);
      top += pair_width(a, b) * weight[a * m + b];
      bottom += weight[a * m + b];
    }
  }

  if (!(bottom > kVanishing)) return 0;
  const double k = top / bottom;
  if (per_k == 0) return k;
  for (std::size_t a = 0; a < m; ++a) {
    for (std::size_t b = a + 1; b < m; ++b) {
      const double reach =
          std::min(branches_[near.branch[a]].radius, branches_[near.branch[b]].radius);
      const double per_weight = per_k * (pair_width(a, b) - k) / bottom;
      const double w = weight[a * m + b];
      on_distance[a] -= per_weight * w / reach;
      on_distance[b] -= per_weight * w / reach;
      on_agreement[a * m + b] -= per_weight * w / (kDisagreement - near.agreement[a * m + b]);
    }
  }
  return k;
}

// From derivatives by distances and agreements (upper triangle) to the gradient.
Vec3 JunctionTarget::gradient(const Near& near, const double* on_distance,
                              const double* on_agreement) const {
  const std::size_t m = near.count;
  Vec3 sum = Vec3::Zero();
  for (std::size_t a = 0; a < m; ++a) {
    sum += on_distance[a] * near.distance[a].gradient;
    for (std::size_t b = a + 1; b < m; ++b) {
      if (near.agreement[a * m + b] == 0) continue;
      sum += on_agreement[a * m + b] *
             agreement_gradient(near.distance[a], branches_[near.branch[a]].direction,
                                near.distance[b], branches_[near.branch[b]].direction);
    }
  }
  return sum;
}

// Derivatives go backwards: from the value to distances and agreements, then to
// the gradient.
JunctionTarget::Value JunctionTarget::at(const Vec3& x) const {
  Near near;
  find_near(x, near);
  const std::size_t m = near.count;

  if (m == 1) {
    const auto own = static_cast<Eigen::Index>(near.branch[0]);
    const double k = widths_(own, own);
    return {near.distance[0].value / k, near.distance[0].gradient / k};
  }

  const double k = width(near, 0, nullptr, nullptr);
  if (!(k > 0)) return {near.least / widths_(0, 0), near.distance[0].gradient / widths_(0, 0)};

  // sum_a w_a^2 / sum_b c_ab w_b, with w scaled by the largest of them.
  std::array<double, kMostActive> w, share, on_distance;
  double sum = 0;
  for (std::size_t a = 0; a < m; ++a) w[a] = std::exp(-(near.distance[a].value - near.least) / k);
  for (std::size_t a = 0; a < m; ++a) {
    double mixed = 0;
    for (std::size_t b = 0; b < m; ++b) mixed += near.agreement[a * m + b] * w[b];
    share[a] = w[a] > 0 ? w[a] / mixed : 0;
    sum += w[a] * share[a];
  }

  // The value is least / k - log(sum), with `least` held while the terms were
  // scaled.
  double per_k = -near.least / (k * k);
  Square on_agreement;
  for (std::size_t a = 0; a < m; ++a) {
    double per_w = 2 * share[a];
    for (std::size_t b = 0; b < m; ++b) {
      per_w -= share[b] * share[b] * near.agreement[a * m + b];
      if (b <= a) continue;
      on_agreement[a * m + b] = (share[a] * share[a] * w[b] + share[b] * share[b] * w[a]) / sum;
    }
    const double per_exponent = -per_w * w[a] / sum;
    on_distance[a] = -per_exponent / k;
    per_k += per_exponent * (near.distance[a].value - near.least) / (k * k);
  }

  if (m > 2) width(near, per_k, on_distance.data(), on_agreement.data());

  return {near.least / k - std::log(sum), gradient(near, on_distance.data(), on_agreement.data())};
}

JunctionTarget::Foot JunctionTarget::foot(const Vec3& x) const {
  const Value v = at(x);
  const double slope = v.gradient.norm();
  return {v.value / slope, v.gradient / slope};
}

Vec3 JunctionTarget::outermost_on_ray(const Vec3& w, double longest) const {
  double outside = longest;
  double t = longest;

  double distance = foot(t * w).distance;
  if (distance <= 0) return longest * w;
  while (distance > 0 && t > 0) {
    outside = t;
    t = std::max(0.0, t - std::max(distance, kLeastRayStep * longest));
    distance = foot(t * w).distance;
  }

  // Bisection between the last two.
  double inside = t;
  for (int k = 0; k < kRayHalvings; ++k) {
    const double middle = (inside + outside) / 2;
    (foot(middle * w).distance > 0 ? outside : inside) = middle;
  }
  return inside * w;
}

Vec3 JunctionTarget::on_ray(const Vec3& w, double longest) const {
  if (branches_.size() > rays_) return outermost_on_ray(w, longest);
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

  // Newton's method along the ray, no step longer than a fifth of the way.
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
  std::optional<Distance> mine;
  double sum = 0;
  for (std::size_t j = 0; j < branches_.size(); ++j) {
    if (j == own || j == core_of_[own]) continue;
    const double k = widths_(i, static_cast<Eigen::Index>(j));
    if (capsule_value(branches_[j], x) > kNegligible * k) continue;
    if (!mine) mine = capsule(branches_[own], x);
    const Distance other = capsule(branches_[j], x);
    sum += std::exp(-other.value / k) * (1.01 - agreement(*mine, other));
  }
  return sum;
}

double JunctionTarget::union_distance(const Vec3& x) const {
  double least = std::numeric_limits<double>::infinity();
  for (const TargetBranch& branch : branches_) least = std::min(least, capsule_value(branch, x));
  return least;
}

}  // namespace angiospline
