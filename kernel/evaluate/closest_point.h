// The point of a curve or surface that is nearest to a given point.
#pragma once

#include <Eigen/Core>

#include "kernel/spline/curve.h"
#include "kernel/spline/surface.h"

namespace angiospline {

template <int D>
struct CurvePoint {
  double t;
  Eigen::Matrix<double, D, 1> point;
  double distance;
  double lower_bound = 0.0;  // no point of the curve is nearer than this; 0 where unknown
};

template <int D>
struct SurfacePoint {
  double u;
  double v;
  Eigen::Matrix<double, D, 1> point;
  double distance;
  double lower_bound = 0.0;  // no point of the surface is nearer than this; 0 where unknown
};

// The nearest point over the whole domain; one of them where several are equally near. It is a
// local minimum to rounding and proven global: the squared distance over a span is a polynomial
// whose Bernstein coefficients bound it, and spans are halved until the bound is above what was
// found (less 1e-12 of the largest squared distance of the span) or the polynomial is convex around
// it. `lower_bound` says what was proven; it is below that only where a hundred thousand halves did
// not do. Spans whose control points are farther than the best so far are left out, nearest first;
// each promising one starts a safeguarded Newton iteration. O(spans) for the bounds. Curves: D 1
// to 4. Surfaces: D 2 to 4.
template <int D>
CurvePoint<D> closest_point(const BSplineCurve<D>& curve,
                            const Eigen::Matrix<double, D, 1>& target);
template <int D>
SurfacePoint<D> closest_point(const BSplineSurface<D>& surface,
                              const Eigen::Matrix<double, D, 1>& target);

// The same on rational ones (homogeneous, positive weights). Curves: D 1 to 3. Surfaces: 2 or 3.
template <int D>
CurvePoint<D> closest_point_rational(const BSplineCurve<D + 1>& curve,
                                     const Eigen::Matrix<double, D, 1>& target);
template <int D>
SurfacePoint<D> closest_point_rational(const BSplineSurface<D + 1>& surface,
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
