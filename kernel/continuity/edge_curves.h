// What a surface does along one of its four sides.
#pragma once

#include "kernel/spline/curve.h"
#include "kernel/spline/surface.h"

namespace angiospline {

// The sides u = first, u = last, v = first, v = last, each directed along its growing parameter.
enum class SurfaceSide { kU0, kU1, kV0, kV1 };

// The knots along a side: those of v for kU0 and kU1, of u for kV0 and kV1.
template <int D>
const KnotVector& side_knots(const BSplineSurface<D>& surface, SurfaceSide side);

// The boundary curve H of the side (thesis 3.2.1); H' is derivative() of it. For ends clamped
// across the side these are its control points. D is 2 to 4.
template <int D>
BSplineCurve<D> boundary_curve(const BSplineSurface<D>& surface, SurfaceSide side);

// The cross-boundary derivative F': dS/du along kU0 and kU1, dS/dv along kV0 and kV1, in the sense
// of the growing parameter, as a spline over the knots of the side. `order` differentiates again.
template <int D>
BSplineCurve<D> cross_derivative_curve(const BSplineSurface<D>& surface, SurfaceSide side,
                                       int order = 1);

}  // namespace angiospline
