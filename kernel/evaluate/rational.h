// Rational curves and surfaces, held homogeneous: (w x, w y, ..., w), the weight last.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "kernel/evaluate/grid.h"
#include "kernel/spline/curve.h"
#include "kernel/spline/surface.h"

namespace angiospline {

// The projected point and its derivatives up to `derivatives`: column k is the k-th. D, the
// dimension of the projected curve, is 1 to 3. Requires a positive weight at t. Reference: The
// NURBS Book, (4.8) and (4.20).
template <int D>
Eigen::Matrix<double, D, Eigen::Dynamic> rational_derivatives(const BSplineCurve<D + 1>& curve,
                                                              double t, int derivatives);

// All partials up to total order `derivatives` of the projected surface, in the order of
// SurfaceGrid::partial: (0,0), (1,0), (0,1), (2,0), (1,1), (0,2), ... D is 2 or 3.
template <int D>
Eigen::Matrix<double, D, Eigen::Dynamic> rational_derivatives(const BSplineSurface<D + 1>& surface,
                                                              double u, double v, int derivatives);

// The same for every point of a grid of homogeneous values: all partials it has, projected. D is 2
// or 3. Requires positive weights there.
template <int D>
SurfaceGrid<D> projected(const SurfaceGrid<D + 1>& grid);

// Homogeneous control points from points and weights (all positive), and back.
template <int D>
Eigen::Matrix<double, D + 1, Eigen::Dynamic> homogeneous(
    const Eigen::Matrix<double, D, Eigen::Dynamic>& points, const Eigen::VectorXd& weights);
template <int D>
Eigen::Matrix<double, D, Eigen::Dynamic> projected(
    const Eigen::Matrix<double, D + 1, Eigen::Dynamic>& points);

}  // namespace angiospline
