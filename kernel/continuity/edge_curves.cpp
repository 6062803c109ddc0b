#include "kernel/continuity/edge_curves.h"

#include "base/contract.h"
#include "kernel/spline/basis.h"

namespace angiospline {
namespace {

bool is_u(SurfaceSide side) { return side == SurfaceSide::kU0 || side == SurfaceSide::kU1; }
bool is_first(SurfaceSide side) { return side == SurfaceSide::kU0 || side == SurfaceSide::kV0; }

}  // namespace

template <int D>
const KnotVector& side_knots(const BSplineSurface<D>& surface, SurfaceSide side) {
  return is_u(side) ? surface.v() : surface.u();
}

template <int D>
BSplineCurve<D> cross_derivative_curve(const BSplineSurface<D>& surface, SurfaceSide side,
                                       int order) {
  EXPECTS(order >= 0);
  const KnotVector& across = is_u(side) ? surface.u() : surface.v();
  const KnotVector& along = side_knots(surface, side);
  const BasisValues b = basis_at(across, is_first(side) ? across.first() : across.last(), order);
  typename BSplineCurve<D>::ControlPoints points =
      BSplineCurve<D>::ControlPoints::Zero(D, along.control_point_count());
  for (int k = 0; k < across.order(); ++k) {
    const double factor = b.values(order, k);
    if (factor == 0) continue;
    for (int j = 0; j < along.control_point_count(); ++j) {
      points.col(j) += factor * (is_u(side) ? surface.control_point(b.first + k, j)
                                            : surface.control_point(j, b.first + k));
    }
  }
  return BSplineCurve<D>(along, std::move(points));
}

template <int D>
BSplineCurve<D> boundary_curve(const BSplineSurface<D>& surface, SurfaceSide side) {
  return cross_derivative_curve(surface, side, 0);
}

#define ANGIOSPLINE_INSTANTIATE(D)                                                \
  template const KnotVector& side_knots(const BSplineSurface<D>&, SurfaceSide);   \
  template BSplineCurve<D> boundary_curve(const BSplineSurface<D>&, SurfaceSide); \
  template BSplineCurve<D> cross_derivative_curve(const BSplineSurface<D>&, SurfaceSide, int);
ANGIOSPLINE_INSTANTIATE(2)
ANGIOSPLINE_INSTANTIATE(3)
ANGIOSPLINE_INSTANTIATE(4)
#undef ANGIOSPLINE_INSTANTIATE

}  // namespace angiospline
