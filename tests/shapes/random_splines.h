// Random splines for the kernel's tests: every kind of knot vector the invariants allow.
#pragma once

#include <algorithm>
#include <vector>

#include <Eigen/Core>

#include "base/random.h"
#include "kernel/spline/curve.h"
#include "kernel/spline/surface.h"

namespace angiospline {

// Degree 1 .. 7, 1 .. 8 spans, interior multiplicities up to `max_multiplicity` (0: the degree),
// ends clamped or, every third time, floating.
inline KnotVector random_knots(Random& random, int degree, int max_multiplicity = 0,
                               bool may_float = true) {
  const int most =
      max_multiplicity > 0 ? std::min(max_multiplicity, degree + 1) : std::max(degree, 1);
  const bool floating = may_float && random.below(3) == 0;
  std::vector<double> knots;
  double t = random.uniform(-3, 3);
  const auto push = [&](int count) {
    knots.insert(knots.end(), static_cast<std::size_t>(count), t);
  };
  const auto advance = [&] {
    t += random.uniform(0.02, 1.0) * (random.below(4) == 0 ? 0.01 : 1.0);
  };
  const auto push_end = [&] {
    if (!floating) return push(degree + 1);
    for (int k = 0; k <= degree; ++k) {
      push(1);
      advance();
    }
  };
  push_end();
  const int interior = random.below(8);
  for (int k = 0; k < interior; ++k) {
    advance();
    push(1 + random.below(most));
  }
  advance();
  push_end();
  return *KnotVector::make(degree, knots);
}

template <int D>
BSplineCurve<D> random_curve(Random& random, const KnotVector& knots) {
  Eigen::Matrix<double, D, Eigen::Dynamic> points(D, knots.control_point_count());
  for (Eigen::Index i = 0; i < points.size(); ++i) points.data()[i] = random.uniform(-1, 1);
  return BSplineCurve<D>(knots, points);
}

template <int D>
BSplineSurface<D> random_surface(Random& random, const KnotVector& u, const KnotVector& v) {
  Eigen::Matrix<double, D, Eigen::Dynamic> points(
      D, static_cast<Eigen::Index>(u.control_point_count()) * v.control_point_count());
  for (Eigen::Index i = 0; i < points.size(); ++i) points.data()[i] = random.uniform(-1, 1);
  return BSplineSurface<D>(u, v, points);
}

// A parameter of the domain; now and then a knot or an end.
inline double random_parameter(Random& random, const KnotVector& knots) {
  switch (random.below(6)) {
    case 0:
      return knots.first();
    case 1:
      return knots.last();
    case 2:
      return knots[knots.degree() + random.below(knots.control_point_count() - knots.degree() + 1)];
    default:
      return random.uniform(knots.first(), knots.last());
  }
}

// Knots to add, some of them on old knots, never above the order in multiplicity.
inline std::vector<double> random_new_knots(Random& random, const KnotVector& knots, int count) {
  std::vector<double> added;
  for (int k = 0; k < count; ++k) {
    double t = random_parameter(random, knots);
    if (random.below(4) == 0 && !added.empty()) t = added.back();
    const auto already = std::count(added.begin(), added.end(), t);
    if (knots.multiplicity(t) + already < knots.order()) added.push_back(t);
  }
  return added;
}

}  // namespace angiospline
