#include "kernel/evaluate/grid.h"

#include <algorithm>
#include <cmath>

#include "base/contract.h"
#include "kernel/fit/fit.h"

namespace angiospline {

namespace {

// out = sum over k of factors[k] * (row k); `rows` starts with row 0 and has `length` doubles a
// row. kOrder > 0 is the number of rows known at compile time.
template <int kOrder>
EIGEN_ALWAYS_INLINE void sum_once(const double* factors, int order, const double* rows,
                                  std::ptrdiff_t length, double* __restrict out) {
  const int count = kOrder > 0 ? kOrder : order;
  for (std::ptrdiff_t x = 0; x < length; ++x) {
    double sum = factors[0] * rows[x];
    for (int k = 1; k < count; ++k) sum += factors[k] * rows[k * length + x];
    out[x] = sum;
  }
}

// Two such sums over the same rows, which are then loaded once.
template <int kOrder>
EIGEN_ALWAYS_INLINE void sum_twice(const double* factors_a, const double* factors_b, int order,
                                   const double* rows, std::ptrdiff_t length,
                                   double* __restrict out_a, double* __restrict out_b) {
  const int count = kOrder > 0 ? kOrder : order;
  for (std::ptrdiff_t x = 0; x < length; ++x) {
    double a = factors_a[0] * rows[x];
    double b = factors_b[0] * rows[x];
    for (int k = 1; k < count; ++k) {
      const double value = rows[k * length + x];
      a += factors_a[k] * value;
      b += factors_b[k] * value;
    }
    out_a[x] = a;
    out_b[x] = b;
  }
}

// The two for one order, in the widest instructions that this processor has. Each sum is of the
// same terms in the same order and nothing is fused, so the bits do not depend on it.
struct Sums {
  void (*once)(const double*, int, const double*, std::ptrdiff_t, double*);
  void (*twice)(const double*, const double*, int, const double*, std::ptrdiff_t, double*, double*);
};

#ifdef __x86_64__
template <int kOrder>
__attribute__((target("avx2"))) void once_avx2(const double* factors, int order, const double* rows,
                                               std::ptrdiff_t length, double* out) {
  sum_once<kOrder>(factors, order, rows, length, out);
}
template <int kOrder>
__attribute__((target("avx2"))) void twice_avx2(const double* factors_a, const double* factors_b,
                                                int order, const double* rows,
                                                std::ptrdiff_t length, double* out_a,
                                                double* out_b) {
  sum_twice<kOrder>(factors_a, factors_b, order, rows, length, out_a, out_b);
}
#endif

template <int kOrder>
Sums sums() {
#ifdef __x86_64__
  if (__builtin_cpu_supports("avx2")) return {once_avx2<kOrder>, twice_avx2<kOrder>};
#endif
  return {sum_once<kOrder>, sum_twice<kOrder>};
}

Sums sums_of(int order) {
  switch (order) {
    case 2:
      return sums<2>();
    case 3:
      return sums<3>();
    case 4:
      return sums<4>();
    case 5:
      return sums<5>();
    case 6:
      return sums<6>();
    default:
      return sums<0>();
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
  const int order = surface.u().order();
  const Sums sum = sums_of(order);
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
        const auto factors = [&](int a) { return along_u[static_cast<std::size_t>(a)].row(i); };
        const auto out = [&](int a) {
          return grid.partials[SurfaceGrid<D>::place(a, b)].data() +
                 D * (static_cast<std::ptrdiff_t>(i) * grid.v_count + from);
        };
        int a = 0;
        for (; a + 1 + b <= derivatives; a += 2) {
          sum.twice(factors(a), factors(a + 1), order, rows, length, out(a), out(a + 1));
        }
        if (a + b <= derivatives) sum.once(factors(a), order, rows, length, out(a));
      }
    }
  }
  return grid;
}

Eigen::Matrix3Xd unit_normals(const SurfaceGrid<3>& grid, Eigen::Matrix3Xd storage) {
  EXPECTS(grid.derivatives >= 1);
  Eigen::Matrix3Xd normals = std::move(storage);
  normals.resize(3, grid.points().cols());
  const double* u = grid.partial(1, 0).data();
  const double* v = grid.partial(0, 1).data();
  double* out = normals.data();
  for (Eigen::Index k = 0; k < normals.size(); k += 3) {
    const double x = u[k + 1] * v[k + 2] - u[k + 2] * v[k + 1];
    const double y = u[k + 2] * v[k] - u[k] * v[k + 2];
    const double z = u[k] * v[k + 1] - u[k + 1] * v[k];
    const double length = std::sqrt(x * x + y * y + z * z);
    const double scale = length > 0 ? 1 / length : 0;
    out[k] = scale * x;
    out[k + 1] = scale * y;
    out[k + 2] = scale * z;
  }
  return normals;
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
