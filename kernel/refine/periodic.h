// Closed curves and surfaces: knots that repeat, control points that wrap around.
#pragma once

#include <optional>
#include <vector>

#include "base/result.h"
#include "kernel/spline/curve.h"
#include "kernel/spline/knot_algebra.h"
#include "kernel/spline/surface.h"

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

// Periodic knots with `added` and all its images merged in; the end of the domain is the image of
// its start. Errors as with_knots, and a multiplicity above the degree. Requires periodic knots.
Result<KnotVector> with_knots_periodic(const KnotVector& knots, std::vector<double> added);

// The closed curve with these distinct control points. Requires periodic knots and their count.
template <int D>
BSplineCurve<D> periodic_curve(const KnotVector& knots,
                               const Eigen::Matrix<double, D, Eigen::Dynamic>& distinct);
template <int D>
bool is_periodic(const BSplineCurve<D>& curve);  // knots repeat and control points wrap exactly

// The surface with these distinct control points, closed in each direction whose knots repeat:
// (i, j) is column i * (distinct ones along v) + j. Requires as many as the knots have.
template <int D>
BSplineSurface<D> periodic_surface(const KnotVector& u, const KnotVector& v,
                                   const Eigen::Matrix<double, D, Eigen::Dynamic>& distinct);
template <int D>
bool is_periodic_u(const BSplineSurface<D>& surface);  // as for curves, in each direction
template <int D>
bool is_periodic_v(const BSplineSurface<D>& surface);

// The control points beyond one period made copies again, which rounding may have left apart.
// Requires periodic knots.
template <int D>
BSplineCurve<D> closed_up(const BSplineCurve<D>& curve);
template <int D>
BSplineSurface<D> closed_up_u(const BSplineSurface<D>& surface);
template <int D>
BSplineSurface<D> closed_up_v(const BSplineSurface<D>& surface);

// Closed curves and surfaces with knots inserted, all their images with them: still closed, the
// same points. Errors as with_knots_periodic; requires the curve or that direction to be closed.
template <int D>
Result<BSplineCurve<D>> insert_knots_periodic(const BSplineCurve<D>& curve,
                                              std::vector<double> added);
template <int D>
Result<BSplineSurface<D>> insert_knots_periodic_u(const BSplineSurface<D>& surface,
                                                  std::vector<double> added);
template <int D>
Result<BSplineSurface<D>> insert_knots_periodic_v(const BSplineSurface<D>& surface,
                                                  std::vector<double> added);

// The same closed curve over [start, start + period]: the seam is moved to `start`, a parameter of
// the domain, which becomes a knot if it is none. Requires is_periodic(curve).
template <int D>
BSplineCurve<D> with_seam(const BSplineCurve<D>& curve, double start);

// The closed least-squares curve over periodic knots; interpolation when there are as many points
// as distinct control points. Parameters in the domain, any order. Errors: counts that differ,
// knots that do not repeat, points that do not determine the curve.
template <int D>
Result<BSplineCurve<D>> fit_periodic(const KnotVector& knots, const std::vector<double>& parameters,
                                     const Eigen::Matrix<double, D, Eigen::Dynamic>& points);

// The least-squares surface on a grid of points, (i, j) at (us[i], vs[j]) in column
// i * vs.size() + j, closed in each direction whose knots repeat; at least one must. Errors as for
// curves, saying which direction.
template <int D>
Result<BSplineSurface<D>> fit_periodic(const KnotVector& u, const KnotVector& v,
                                       const std::vector<double>& us, const std::vector<double>& vs,
                                       const Eigen::Matrix<double, D, Eigen::Dynamic>& points);

}  // namespace angiospline
