#include "kernel/grid.h"

#include <algorithm>

#include "base/contract.h"
#include "kernel/fit.h"

namespace angiospline {

template <int D>
SurfaceGrid<D> evaluate_grid(const BSplineSurface<D>& surface, const std::vector<double>& us,
                             const std::vector<double>& vs, int derivatives) {
  EXPECTS(derivatives >= 0 && derivatives <= KnotVector::kMaxDegree);
  SurfaceGrid<D> grid;
  grid.u_count = static_cast<int>(us.size());
  grid.v_count = static_cast<int>(vs.size());
  grid.derivatives = derivatives;
  grid.partials.resize(static_cast<std::size_t>((derivatives + 1) * (derivatives + 2) / 2));
  std::vector<CompactRows> along_v;
  for (int b = 0; b <= derivatives; ++b) along_v.push_back(collocation_matrix(surface.v(), vs, b));

  const Eigen::Index row = static_cast<Eigen::Index>(D) * surface.v_count();
  std::vector<double> strip(static_cast<std::size_t>(row) * us.size());
  for (int a = 0; a <= derivatives; ++a) {
    collocation_matrix(surface.u(), us, a)
        .apply_blocks(surface.control_points().data(), row, strip.data());
    for (int b = 0; a + b <= derivatives; ++b) {
      auto& out = grid.partials[static_cast<std::size_t>((a + b) * (a + b + 1) / 2 + b)];
      out.resize(D, static_cast<Eigen::Index>(us.size() * vs.size()));
      for (int i = 0; i < grid.u_count; ++i) {
        along_v[static_cast<std::size_t>(b)].apply_blocks(
            strip.data() + row * i, D,
            out.data() + static_cast<Eigen::Index>(D) * i * grid.v_count);
      }
    }
  }
  return grid;
}

template <int D>
Eigen::Matrix<double, D, Eigen::Dynamic> evaluate(const BSplineCurve<D>& curve,
                                                  const std::vector<double>& parameters,
                                                  int derivative) {
  return collocation_matrix(curve.knots(), parameters, derivative)
      .template apply<D>(curve.control_points());
}

std::vector<double> spaced(double first, double last, int count) {
  EXPECTS(count >= 2);
  std::vector<double> parameters(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    parameters[static_cast<std::size_t>(i)] = first + (last - first) * i / (count - 1);
  }
  parameters.back() = last;
  return parameters;
}

#define ANGIOSPLINE_INSTANTIATE(D)                                                            \
  template SurfaceGrid<D> evaluate_grid(const BSplineSurface<D>&, const std::vector<double>&, \
                                        const std::vector<double>&, int);                     \
  template Eigen::Matrix<double, D, Eigen::Dynamic> evaluate(const BSplineCurve<D>&,          \
                                                             const std::vector<double>&, int);
ANGIOSPLINE_INSTANTIATE(1)
ANGIOSPLINE_INSTANTIATE(2)
ANGIOSPLINE_INSTANTIATE(3)
ANGIOSPLINE_INSTANTIATE(4)
#undef ANGIOSPLINE_INSTANTIATE

}  // namespace angiospline
