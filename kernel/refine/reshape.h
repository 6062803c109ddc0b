// The same shape in another form: derivative, elevated, reversed, joined, compatible. Closed curves
// and closed directions of surfaces (kernel/refine/periodic.h) stay closed.
#pragma once

#include <vector>

#include "base/result.h"
#include "kernel/numerics/compact_rows.h"
#include "kernel/spline/curve.h"
#include "kernel/spline/surface.h"

namespace angiospline {

// The derivative as a spline of one degree less over the same domain (degree 0 gives zero). Where a
// curve jumps (multiplicity above the degree) the jump is left out; a closed curve with a corner at
// its seam has a derivative that is not closed. D is 1 to 4 throughout.
template <int D>
BSplineCurve<D> derivative(const BSplineCurve<D>& curve);
template <int D>
BSplineSurface<D> derivative_u(const BSplineSurface<D>& surface);
template <int D>
BSplineSurface<D> derivative_v(const BSplineSurface<D>& surface);

// The same curve or surface with its degree raised by `by`; knots as elevated_knots gives them.
// Exact: each new control point is a mean of blossoms. Requires by >= 0 and the sum within
// kMaxDegree. Reference: Ramshaw 1989; Liu, A simple, efficient degree raising algorithm, 1997.
template <int D>
BSplineCurve<D> elevate(const BSplineCurve<D>& curve, int by = 1);
template <int D>
BSplineSurface<D> elevate(const BSplineSurface<D>& surface, int by_u, int by_v);

// The matrix behind it: control points over elevated_knots(knots, 1) from those over `knots`.
CompactRows elevation_matrix(const KnotVector& knots);

// Run backwards over the same domain, and u and v exchanged. The normal of a surface turns over.
template <int D>
BSplineCurve<D> reverse(const BSplineCurve<D>& curve);
template <int D>
BSplineSurface<D> reverse_u(const BSplineSurface<D>& surface);
template <int D>
BSplineSurface<D> reverse_v(const BSplineSurface<D>& surface);
template <int D>
BSplineSurface<D> swap_uv(const BSplineSurface<D>& surface);

// The same points over another domain (affine reparametrisation).
template <int D>
BSplineCurve<D> over(const BSplineCurve<D>& curve, double first, double last);
template <int D>
BSplineSurface<D> over(const BSplineSurface<D>& surface, double u_first, double u_last,
                       double v_first, double v_last);

// One curve that runs through `first` and then `second`, whose parameters are shifted to follow on
// (not scaled). The joint is a knot of multiplicity degree: C0 there. Degrees may differ; floating
// ends are clamped. Error: the end and the start are more than `gap` apart; their mean becomes the
// joint otherwise.
template <int D>
Result<BSplineCurve<D>> join(const BSplineCurve<D>& first, const BSplineCurve<D>& second,
                             double gap);

// All with the highest degree, the first one's domain and the union of the knots. Where all are
// closed they stay so; otherwise floating ends are clamped first. Requires at least one.
template <int D>
std::vector<BSplineCurve<D>> make_compatible(std::vector<BSplineCurve<D>> curves);

}  // namespace angiospline
