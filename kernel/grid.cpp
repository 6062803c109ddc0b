#include "kernel/grid.h"

#include <algorithm>

#include "base/contract.h"
#include "kernel/fit.h"

namespace angiospline {

namespace {

// out = sum over k of factors[k] * (row k): `rows` starts with row 0 and has `stride` doubles from
// row to row, of which `length` count. kOrder > 0 is the number of rows known at compile time.
template <int kOrder>
void combine_rows(const double* factors, int order, const double* rows, std::ptrdiff_t stride,
                  std::ptrdiff_t length, double* __restrict out) {
  const int count = kOrder > 0 ? kOrder : order;
  for (std::ptrdiff_t x = 0; x < length; ++x) {
    double sum = factors[0] * rows[x];
    for (int k = 1; k < count; ++k) sum += factors[k] * rows[k * stride + x];
    out[x] = sum;
  }
}

using Combination = void (*)(const double*, int, const double*, std::ptrdiff_t, std::ptrdiff_t,
                             double*);

Combination combination_of(int order) {
  switch (order) {
    case 2:
      return combine_rows<2>;
    case 3:
      return combine_rows<3>;
    case 4:
      return combine_rows<4>;
    case 5:
      return combine_rows<5>;
    case 6:
      return combine_rows<6>;
    default:
      return combine_rows<0>;
  }
}

}  // namespace

// In strips of few columns, so that what is contracted along v stays in the cache while all lines
// of the strip are combined from it; and these combinations run over consecutive doubles.
template <int D>
SurfaceGrid<D> evaluate_grid(const BSplineSurface<D>& surface, const std::vector<double>& us,
                             const std::vector<double>& vs, int derivatives,
                             SurfaceGrid<D> storage) {
  EXPECTS(derivatives >= 0 && derivatives <= KnotVector::kMaxDegree);
  SurfaceGrid<D> grid = std::move(storage);
  grid.u_count = static_cast<int>(us.size());
  grid.v_count = static_cast<int>(vs.size());
  grid.derivatives = derivatives;
  grid.partials.resize(static_cast<std::size_t>((derivatives + 1) * (derivatives + 2) / 2));
  for (auto& points : grid.partials) {
    points.resize(D, static_cast<Eigen::Index>(us.size() * vs.size()));
  }
  if (us.empty()) return grid;

  const std::vector<CompactRows> along_u = collocation_matrices(surface.u(), us, derivatives);
  const Combination combine = combination_of(surface.u().order());
  int low = surface.u_count();  // the rows of the net that count
  int high = 0;
  for (int i = 0; i < grid.u_count; ++i) {
    low = std::min(low, along_u.front().first(i));
    high = std::max(high, along_u.front().first(i) + surface.u().order());
  }
  constexpr int kColumns = 32;
  std::vector<double> strip(static_cast<std::size_t>((high - low) * kColumns * D));
  for (int from = 0; from < grid.v_count; from += kColumns) {
    const int to = std::min(from + kColumns, grid.v_count);
    const std::ptrdiff_t length = static_cast<std::ptrdiff_t>(D) * (to - from);
    const std::vector<CompactRows> along_v = collocation_matrices(
        surface.v(), std::vector<double>(vs.begin() + from, vs.begin() + to), derivatives);
    for (int b = 0; b <= derivatives; ++b) {
      for (int k = low; k < high; ++k) {
        along_v[static_cast<std::size_t>(b)].apply_blocks(
            surface.control_points().data() + D * surface.index(k, 0), D,
            strip.data() + length * (k - low));
      }
      for (int i = 0; i < grid.u_count; ++i) {
        const double* rows = strip.data() + length * (along_u.front().first(i) - low);
        for (int a = 0; a + b <= derivatives; ++a) {
          double* out = grid.partials[SurfaceGrid<D>::place(a, b)].data();
          combine(along_u[static_cast<std::size_t>(a)].row(i), surface.u().order(), rows, length,
                  length, out + D * (static_cast<std::ptrdiff_t>(i) * grid.v_count + from));
        }
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
                                        const std::vector<double>&, int, SurfaceGrid<D>);     \
  template Eigen::Matrix<double, D, Eigen::Dynamic> evaluate(const BSplineCurve<D>&,          \
                                                             const std::vector<double>&, int);
ANGIOSPLINE_INSTANTIATE(1)
ANGIOSPLINE_INSTANTIATE(2)
ANGIOSPLINE_INSTANTIATE(3)
ANGIOSPLINE_INSTANTIATE(4)
#undef ANGIOSPLINE_INSTANTIATE

}  // namespace angiospline
