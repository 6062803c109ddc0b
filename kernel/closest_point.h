// The point of a curve or surface that is nearest to a given point.
#pragma once

#include <Eigen/Core>

#include "kernel/curve.h"
#include "kernel/surface.h"

namespace angiospline {

template <int D>
struct CurvePoint {
  double t;
  Eigen::Matrix<double, D, 1> point;
  double distance;
};

template <int D>
struct SurfacePoint {
  double u;
  double v;
  Eigen::Matrix<double, D, 1> point;
  double distance;
};

// The nearest point over the whole domain. Every span whose control points come nearer than the
// best point so far (a lower bound, by the convex hull) is sampled at order() + 1 parameters along
// each direction, and each local minimum of the samples is refined by a safeguarded Newton
// iteration. So the answer is a local minimum to rounding, and the global one unless a span hides a
// second minimum between its samples. Where several are equally near, the first in parameter order.
// Curves: D 1 to 4. Surfaces: D 2 to 4. O(spans) for the bounds.
template <int D>
CurvePoint<D> closest_point(const BSplineCurve<D>& curve,
                            const Eigen::Matrix<double, D, 1>& target);
template <int D>
SurfacePoint<D> closest_point(const BSplineSurface<D>& surface,
                              const Eigen::Matrix<double, D, 1>& target);

// The local minimum that the iteration reaches from the start parameters (clamped to the domain).
template <int D>
CurvePoint<D> closest_point_from(const BSplineCurve<D>& curve,
                                 const Eigen::Matrix<double, D, 1>& target, double start);
template <int D>
SurfacePoint<D> closest_point_from(const BSplineSurface<D>& surface,
                                   const Eigen::Matrix<double, D, 1>& target, double start_u,
                                   double start_v);

}  // namespace angiospline
