#include "kernel/grid.h"

#include <algorithm>
#include <array>

#include "base/contract.h"
#include "kernel/fit.h"

namespace angiospline {

namespace {

// One line of the grid with first partials: `pairs` holds for each control point along v the point
// and the u-derivative of the line, 2 D doubles, and one spare pair.
template <int D, int kOrder>
void line_with_partials(const CompactRows& values, const CompactRows& slopes, const double* pairs,
                        double* points, double* by_u, double* by_v) {
  using Pair = Eigen::Matrix<double, 2 * D, 1>;
  using Half = Eigen::Matrix<double, D + D % 2, 1>;
  for (int j = 0; j < values.rows(); ++j) {
    const double* block = pairs + 2 * D * values.first(j);
    const double* N = values.row(j);
    const double* M = slopes.row(j);
    Pair pair = N[0] * Eigen::Map<const Pair>(block);
    Half across = M[0] * Eigen::Map<const Half>(block);
    for (int k = 1; k < kOrder; ++k) {
      pair += N[k] * Eigen::Map<const Pair>(block + 2 * D * k);
      across += M[k] * Eigen::Map<const Half>(block + 2 * D * k);
    }
    for (int c = 0; c < D; ++c) {
      points[c] = pair(c);
      by_u[c] = pair(D + c);
      by_v[c] = across(c);
    }
    points += D;
    by_u += D;
    by_v += D;
  }
}

template <int D>
using LineFunction = void (*)(const CompactRows&, const CompactRows&, const double*, double*,
                              double*, double*);

template <int D>
LineFunction<D> line_function(int order) {
  switch (order) {
    case 2:
      return line_with_partials<D, 2>;
    case 3:
      return line_with_partials<D, 3>;
    case 4:
      return line_with_partials<D, 4>;
    case 5:
      return line_with_partials<D, 5>;
    case 6:
      return line_with_partials<D, 6>;
    default:
      return nullptr;
  }
}

struct ValuesAndSlopes {
  CompactRows values;
  CompactRows slopes;
};

ValuesAndSlopes values_and_slopes(const KnotVector& knots, const std::vector<double>& parameters) {
  const int order = knots.order();
  const int rows = static_cast<int>(parameters.size());
  ValuesAndSlopes result{CompactRows(rows, knots.control_point_count(), order),
                         CompactRows(rows, knots.control_point_count(), order)};
  std::array<double, 2 * (KnotVector::kMaxDegree + 1)> basis;
  int span = -1;
  for (int r = 0; r < rows; ++r) {
    const double t = parameters[static_cast<std::size_t>(r)];
    span = knots.span(t, span);
    basis_on_span(knots, span, t, 1, basis.data());
    result.values.set_row(r, span - knots.degree(), basis.data(), order);
    result.slopes.set_row(r, span - knots.degree(), basis.data() + order, order);
  }
  return result;
}

// Points and first partials in one pass over the lines.
template <int D>
void fill_first_partials(const BSplineSurface<D>& surface, const std::vector<double>& us,
                         const std::vector<double>& vs, LineFunction<D> line,
                         SurfaceGrid<D>& grid) {
  const auto [u_values, u_slopes] = values_and_slopes(surface.u(), us);
  const auto [v_values, v_slopes] = values_and_slopes(surface.v(), vs);
  const int count = surface.v_count();
  std::vector<double> pairs(static_cast<std::size_t>(2 * D * (count + 1)));
  std::vector<double> value(static_cast<std::size_t>(D * count));
  std::vector<double> slope(value.size());
  for (int i = 0; i < grid.u_count; ++i) {
    const double* N = u_values.row(i);
    const double* M = u_slopes.row(i);
    std::fill(value.begin(), value.end(), 0.0);
    std::fill(slope.begin(), slope.end(), 0.0);
    for (int k = 0; k < u_values.width(); ++k) {
      const double* row =
          surface.control_points().data() + D * surface.index(u_values.first(i) + k, 0);
      for (std::size_t c = 0; c < value.size(); ++c) {
        value[c] += N[k] * row[c];
        slope[c] += M[k] * row[c];
      }
    }
    for (int j = 0; j < count; ++j) {
      std::copy_n(value.data() + D * j, D, pairs.data() + 2 * D * j);
      std::copy_n(slope.data() + D * j, D, pairs.data() + 2 * D * j + D);
    }
    const Eigen::Index offset = static_cast<Eigen::Index>(D) * i * grid.v_count;
    line(v_values, v_slopes, pairs.data(), grid.partials[0].data() + offset,
         grid.partials[1].data() + offset, grid.partials[2].data() + offset);
  }
}

}  // namespace

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
  if (const LineFunction<D> line = line_function<D>(surface.v().order());
      derivatives == 1 && line != nullptr) {
    fill_first_partials<D>(surface, us, vs, line, grid);
    return grid;
  }
  std::vector<CompactRows> along_v;
  for (int b = 0; b <= derivatives; ++b) along_v.push_back(collocation_matrix(surface.v(), vs, b));
  const Eigen::Index row = static_cast<Eigen::Index>(D) * surface.v_count();
  std::vector<double> strip(static_cast<std::size_t>(row) * us.size());
  for (int a = 0; a <= derivatives; ++a) {
    collocation_matrix(surface.u(), us, a)
        .apply_blocks(surface.control_points().data(), row, strip.data());
    for (int b = 0; a + b <= derivatives; ++b) {
      auto& out = grid.partials[static_cast<std::size_t>((a + b) * (a + b + 1) / 2 + b)];
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
                                        const std::vector<double>&, int, SurfaceGrid<D>);     \
  template Eigen::Matrix<double, D, Eigen::Dynamic> evaluate(const BSplineCurve<D>&,          \
                                                             const std::vector<double>&, int);
ANGIOSPLINE_INSTANTIATE(1)
ANGIOSPLINE_INSTANTIATE(2)
ANGIOSPLINE_INSTANTIATE(3)
ANGIOSPLINE_INSTANTIATE(4)
#undef ANGIOSPLINE_INSTANTIATE

}  // namespace angiospline
