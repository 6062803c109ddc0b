// Paths with room to change.
#pragma once

#include "kernel/spline/curve.h"

namespace angiospline {

// The same path (x, y, z and radius over its length) with a knot at least every mean radius: a
// straight one may have a handful of control points, too few to move or thin a part of it.
BSplineCurve<4> with_knots_each_radius(const BSplineCurve<4>& path);

}  // namespace angiospline
