// Closed curves: knots that repeat, control points that wrap around.
#pragma once

#include <optional>
#include <vector>

#include "base/result.h"
#include "kernel/curve.h"
#include "kernel/knot_algebra.h"

namespace angiospline {

// Floating knots that repeat with period last - first. `knots` are the distinct knots of one
// period, the start included and the end left out (it is the image of the start); their
// multiplicities sum to the number of distinct control points. Errors: multiplicity above the
// degree (the curve would break), an end not above all knots, no knot, fewer knots than the
// invariants need.
Result<KnotVector> periodic_knots(int degree, const std::vector<Knot>& knots, double end);

// The number of distinct control points if the knots repeat with the period of the domain (to
// rounding), or nothing. Control point i + that number is then a copy of control point i.
std::optional<int> periodic_count(const KnotVector& knots);

// The closed curve with these distinct control points. Requires periodic knots and their count.
template <int D>
BSplineCurve<D> periodic_curve(const KnotVector& knots,
                               const Eigen::Matrix<double, D, Eigen::Dynamic>& distinct);
template <int D>
bool is_periodic(const BSplineCurve<D>& curve);  // knots repeat and control points wrap exactly

// A closed curve with knots inserted, all their images with them: still periodic, the same points.
// Errors as with_knots; requires is_periodic(curve).
template <int D>
Result<BSplineCurve<D>> insert_knots_periodic(const BSplineCurve<D>& curve,
                                              std::vector<double> added);

// The closed least-squares curve over periodic knots; interpolation when there are as many points
// as distinct control points. Parameters in the domain, any order. Errors: counts that differ,
// knots that do not repeat, points that do not determine the curve.
template <int D>
Result<BSplineCurve<D>> fit_periodic(const KnotVector& knots, const std::vector<double>& parameters,
                                     const Eigen::Matrix<double, D, Eigen::Dynamic>& points);

}  // namespace angiospline
