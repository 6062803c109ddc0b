// Tolerances on rational curves and surfaces, carried over to their homogeneous forms.
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/contract.h"
#include "kernel/evaluate/rational.h"
#include "kernel/reduce/reduce.h"
#include "kernel/refine/control_mesh.h"

namespace angiospline {
namespace {

// Homogeneous coordinates balanced about the middle of the projected control points: (P - c w, R w)
// with R the largest distance of a projected control point from c. Both halves then count alike:
// for x = (P - c w) / w, of length at most R, and another x' with control points nearer than e,
//   x' - x = (d(P - c w) - x dw) / w',   |x' - x| <= (|d(P - c w)| + R |dw|) / w'
//                                               <= sqrt(2) e / (least weight - e / R).
template <int D>
class Balance {
 public:
  using Homogeneous = Eigen::Matrix<double, D + 1, Eigen::Dynamic>;

  // Requires positive weights.
  explicit Balance(const Homogeneous& points) : least_weight_(points.row(D).minCoeff()) {
    EXPECTS(least_weight_ > 0);
    const Eigen::Matrix<double, D, Eigen::Dynamic> projections = projected<D>(points);
    middle_ = 0.5 * (projections.rowwise().minCoeff() + projections.rowwise().maxCoeff());
    radius_ = (projections.colwise() - middle_).colwise().norm().maxCoeff();
    if (!(radius_ > 0)) radius_ = 1;  // one point: any balance will do
  }

  Homogeneous balanced(Homogeneous points) const {
    points.template topRows<D>() -= middle_ * points.row(D);
    points.row(D) *= radius_;
    return points;
  }
  Homogeneous restored(Homogeneous points) const {
    points.row(D) /= radius_;
    points.template topRows<D>() += middle_ * points.row(D);
    return points;
  }

  // The distance e of control points that allows projections to be `tolerance` apart, and back.
  double allowed(double tolerance) const {
    return tolerance * least_weight_ / (std::sqrt(2.0) + tolerance / radius_);
  }
  double projected_bound(double e) const {
    return std::sqrt(2.0) * e / (least_weight_ - e / radius_);
  }

 private:
  double least_weight_;
  Eigen::Matrix<double, D, 1> middle_;
  double radius_;
};

}  // namespace

template <int D>
Result<ReducedCurve<D + 1>> reduce_rational(const BSplineCurve<D + 1>& curve,
                                            ReductionOptions options) {
  const Balance<D> balance(curve.control_points());
  const double tolerance = options.tolerance;
  if (tolerance > 0) options.tolerance = balance.allowed(tolerance);
  auto reduced =
      reduce(BSplineCurve<D + 1>(curve.knots(), balance.balanced(curve.control_points())), options);
  if (!reduced) return fail(reduced.error());
  return ReducedCurve<D + 1>{BSplineCurve<D + 1>(reduced->curve.knots(),
                                                 balance.restored(reduced->curve.control_points())),
                             std::min(tolerance, balance.projected_bound(reduced->error_bound)),
                             reduced->trials};
}

template <int D>
Result<ReducedSurface<D + 1>> reduce_rational(const BSplineSurface<D + 1>& surface,
                                              SurfaceReductionOptions options) {
  const Balance<D> balance(surface.control_points());
  const double tolerance = options.tolerance;
  if (tolerance > 0) options.tolerance = balance.allowed(tolerance);
  auto reduced = reduce(
      BSplineSurface<D + 1>(surface.u(), surface.v(), balance.balanced(surface.control_points())),
      options);
  if (!reduced) return fail(reduced.error());
  const BSplineSurface<D + 1>& s = reduced->surface;
  return ReducedSurface<D + 1>{
      BSplineSurface<D + 1>(s.u(), s.v(), balance.restored(s.control_points())),
      std::min(tolerance, balance.projected_bound(reduced->error_bound)), reduced->trials,
      reduced->order};
}

template <int D>
Result<RefinedCurve<D + 1>> refine_to_tolerance_rational(const BSplineCurve<D + 1>& curve,
                                                         MeshOptions options) {
  const Balance<D> balance(curve.control_points());
  const double tolerance = options.tolerance;
  if (tolerance > 0) options.tolerance = balance.allowed(tolerance);
  auto refined = refine_to_tolerance(
      BSplineCurve<D + 1>(curve.knots(), balance.balanced(curve.control_points())), options);
  if (!refined) return fail(refined.error());
  return RefinedCurve<D + 1>{BSplineCurve<D + 1>(refined->curve.knots(),
                                                 balance.restored(refined->curve.control_points())),
                             std::min(tolerance, balance.projected_bound(refined->distance))};
}

template <int D>
Result<RefinedSurface<D + 1>> refine_to_tolerance_rational(const BSplineSurface<D + 1>& surface,
                                                           MeshOptions options) {
  const Balance<D> balance(surface.control_points());
  const double tolerance = options.tolerance;
  if (tolerance > 0) options.tolerance = balance.allowed(tolerance);
  auto refined = refine_to_tolerance(
      BSplineSurface<D + 1>(surface.u(), surface.v(), balance.balanced(surface.control_points())),
      options);
  if (!refined) return fail(refined.error());
  const BSplineSurface<D + 1>& s = refined->surface;
  return RefinedSurface<D + 1>{
      BSplineSurface<D + 1>(s.u(), s.v(), balance.restored(s.control_points())),
      std::min(tolerance, balance.projected_bound(refined->distance))};
}

#define ANGIOSPLINE_INSTANTIATE(D)                                                                 \
  template Result<ReducedCurve<D + 1>> reduce_rational<D>(const BSplineCurve<D + 1>&,              \
                                                          ReductionOptions);                       \
  template Result<RefinedCurve<D + 1>> refine_to_tolerance_rational<D>(const BSplineCurve<D + 1>&, \
                                                                       MeshOptions);
ANGIOSPLINE_INSTANTIATE(1)
ANGIOSPLINE_INSTANTIATE(2)
ANGIOSPLINE_INSTANTIATE(3)
#undef ANGIOSPLINE_INSTANTIATE
#define ANGIOSPLINE_INSTANTIATE(D)                                                        \
  template Result<ReducedSurface<D + 1>> reduce_rational<D>(const BSplineSurface<D + 1>&, \
                                                            SurfaceReductionOptions);     \
  template Result<RefinedSurface<D + 1>> refine_to_tolerance_rational<D>(                 \
      const BSplineSurface<D + 1>&, MeshOptions);
ANGIOSPLINE_INSTANTIATE(2)
ANGIOSPLINE_INSTANTIATE(3)
#undef ANGIOSPLINE_INSTANTIATE

}  // namespace angiospline
