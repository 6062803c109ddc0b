// Curves and surfaces at many parameters at once.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "kernel/spline/curve.h"
#include "kernel/spline/surface.h"

namespace angiospline {

// A surface and its partial derivatives on a grid of parameters.
template <int D>
struct SurfaceGrid {
  using Points = Eigen::Matrix<double, D, Eigen::Dynamic>;

  int u_count = 0;
  int v_count = 0;
  int derivatives = 0;
  std::vector<Points> partials;  // see partial()

  // d^(a+b) S / du^a dv^b at every grid point, a + b <= derivatives; point (i, j) is column
  // i * v_count + j. a = b = 0: the points.
  const Points& partial(int a, int b) const { return partials[place(a, b)]; }
  static std::size_t place(int a, int b) {
    return static_cast<std::size_t>((a + b) * (a + b + 1) / 2 + b);
  }
  const Points& points() const { return partials.front(); }
};

// All partials up to total order `derivatives` at (us[i], vs[j]). The tensor structure is used:
// basis functions are computed once for each parameter, and v is contracted before u. D is 1 to 4.
// O(|us| |vs| order_u) after O(|vs| u_count order_v). `storage`, an earlier grid, gives its memory.
template <int D>
SurfaceGrid<D> evaluate_grid(const BSplineSurface<D>& surface, const std::vector<double>& us,
                             const std::vector<double>& vs, int derivatives = 0,
                             SurfaceGrid<D> storage = {});

// The unit normals Su x Sv / |Su x Sv| at every grid point, one column each; zero where the surface
// is singular. Requires derivatives >= 1. `storage`, an earlier result, gives its memory.
Eigen::Matrix3Xd unit_normals(const SurfaceGrid<3>& grid, Eigen::Matrix3Xd storage = {});

// The k-th derivative of a curve at every parameter, one column each.
template <int D>
Eigen::Matrix<double, D, Eigen::Dynamic> evaluate(const BSplineCurve<D>& curve,
                                                  const std::vector<double>& parameters,
                                                  int derivative = 0);

// `count` parameters from `first` to `last`, both included and exact. Requires count >= 2.
std::vector<double> spaced(double first, double last, int count);

}  // namespace angiospline
