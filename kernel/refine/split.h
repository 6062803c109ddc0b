// Cutting curves and surfaces at parameters, by exact knot insertion.
#pragma once

#include <utility>
#include <vector>

#include "kernel/spline/curve.h"
#include "kernel/spline/surface.h"

namespace angiospline {

// The part over [from, to], clamped at both ends, with the parameters it had. Clamps a floating or
// periodic curve when given its whole domain. Requires first() <= from < to <= last(). D is 1 to 4.
template <int D>
BSplineCurve<D> restrict_to(const BSplineCurve<D>& curve, double from, double to);
template <int D>
BSplineSurface<D> restrict_u(const BSplineSurface<D>& surface, double from, double to);
template <int D>
BSplineSurface<D> restrict_v(const BSplineSurface<D>& surface, double from, double to);

// Two parts that meet at t. Requires first() < t < last().
template <int D>
std::pair<BSplineCurve<D>, BSplineCurve<D>> split(const BSplineCurve<D>& curve, double t);
template <int D>
std::pair<BSplineSurface<D>, BSplineSurface<D>> split_u(const BSplineSurface<D>& surface, double u);
template <int D>
std::pair<BSplineSurface<D>, BSplineSurface<D>> split_v(const BSplineSurface<D>& surface, double v);

// One Bezier piece for each span of positive length, in order (u outer, v inner), each over its own
// interval of the original parameters.
template <int D>
std::vector<BSplineCurve<D>> bezier_pieces(const BSplineCurve<D>& curve);
template <int D>
std::vector<BSplineSurface<D>> bezier_pieces(const BSplineSurface<D>& surface);

}  // namespace angiospline
