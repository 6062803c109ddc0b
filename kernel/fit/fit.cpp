#include "kernel/fit/fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "base/contract.h"
#include "kernel/fit/tensor_fit.h"
#include "kernel/numerics/banded.h"
#include "kernel/numerics/quadrature.h"

namespace angiospline {
namespace {

constexpr int kMaxOrder = KnotVector::kMaxDegree + 1;

std::string interval_text(double a, double b) {
  return "[" + std::to_string(a) + ", " + std::to_string(b) + "]";
}

std::optional<Error> parameter_error(const KnotVector& knots,
                                     const std::vector<double>& parameters) {
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (!(parameters[i] >= knots.first() && parameters[i] <= knots.last())) {
      return Error{ErrorKind::kBadInput, "parameter is outside the domain",
                   "parameter " + std::to_string(i), std::to_string(parameters[i]),
                   "must be in " + interval_text(knots.first(), knots.last())};
    }
  }
  return std::nullopt;
}

Error count_error(std::size_t got, std::size_t wanted, const char* what) {
  return Error{ErrorKind::kBadInput, std::string("wrong number of ") + what, "spline fit",
               std::to_string(got), std::to_string(wanted) + " are needed"};
}

// The first and last coefficients, given: one column a coordinate.
struct HeldEnds {
  Eigen::MatrixXd first;  // one row a held control point
  Eigen::MatrixXd last;   // in order; the last row is the last control point
};

// The free block of A' W A + roughness * gram: rows and columns head .. head + size - 1.
BandedCholesky normal_matrix(const CompactRows& A, const Eigen::VectorXd& weights,
                             const CompactRows* gram, double roughness, int head, int size) {
  BandedCholesky N(size, std::min(A.width(), size));
  const auto is_free = [&](int c) { return c >= head && c < head + size; };
  for (int r = 0; r < A.rows(); ++r) {
    const double* a = A.row(r);
    for (int i = 0; i < A.width(); ++i) {
      const int ci = A.first(r) + i;
      if (a[i] == 0 || !is_free(ci)) continue;
      for (int j = 0; j <= i; ++j) {
        if (is_free(A.first(r) + j)) {
          N.at(ci - head, A.first(r) + j - head) += weights(r) * a[i] * a[j];
        }
      }
    }
  }
  if (gram == nullptr) return N;

  for (int r = head; r < head + size; ++r) {
    for (int k = 0; k < gram->width(); ++k) {
      const int c = gram->first(r) + k;
      if (c <= r && c >= head && r - c < A.width()) {
        N.at(r - head, c - head) += roughness * gram->row(r)[k];
      }
    }
  }
  return N;
}

// A' W (values - A x) - roughness * gram x: minus half the gradient of the sum that is minimised.
Eigen::MatrixXd descent(const CompactRows& A, const Eigen::MatrixXd& values,
                        const Eigen::VectorXd& weights, const CompactRows* gram, double roughness,
                        const Eigen::MatrixXd& x) {
  Eigen::MatrixXd gradient = Eigen::MatrixXd::Zero(x.rows(), x.cols());
  for (int r = 0; r < A.rows(); ++r) {
    const double* a = A.row(r);
    Eigen::RowVectorXd rest = values.row(r);
    for (int k = 0; k < A.width(); ++k) rest -= a[k] * x.row(A.first(r) + k);
    rest *= weights(r);
    for (int k = 0; k < A.width(); ++k) gradient.row(A.first(r) + k) += a[k] * rest;
  }
  if (gram == nullptr) return gradient;

  for (int r = 0; r < A.columns(); ++r) {
    for (int k = 0; k < gram->width(); ++k) {
      gradient.row(r) -= roughness * gram->row(r)[k] * x.row(gram->first(r) + k);
    }
  }
  return gradient;
}

Result<Eigen::MatrixXd> least_squares(const CompactRows& A, const Eigen::MatrixXd& values,
                                      const Eigen::VectorXd& weights, const HeldEnds& held,
                                      const CompactRows* gram, double roughness) {
  const int n = A.columns();
  const int head = static_cast<int>(held.first.rows());
  const int tail = static_cast<int>(held.last.rows());
  const int free = n - head - tail;
  Eigen::MatrixXd x = Eigen::MatrixXd::Zero(n, values.cols());
  x.topRows(head) = held.first;
  x.bottomRows(tail) = held.last;
  if (free == 0) return x;

  BandedCholesky N = normal_matrix(A, weights, gram, roughness, head, free);
  if (const int bad = N.factor(); bad >= 0) {
    return fail({ErrorKind::kBadInput,
                 "too few points: a basis function is not determined",
                 "basis function " + std::to_string(bad + head),
                 {},
                 "the points must satisfy the Schoenberg-Whitney conditions"});
  }

  // The solution, then its correction on the residual (Bjorck, Numerical Methods for Least
  // Squares Problems, 1996).
  for (int pass = 0; pass < 2; ++pass) {
    Eigen::MatrixXd step = descent(A, values, weights, gram, roughness, x).middleRows(head, free);
    N.solve(step);
    x.middleRows(head, free) += step;
  }
  return x;
}

Result<HeldEnds> held_ends(const KnotVector& knots, const Eigen::MatrixXd& first_position,
                           const Eigen::MatrixXd& first_derivative,
                           const Eigen::MatrixXd& last_position,
                           const Eigen::MatrixXd& last_derivative, int dimension) {
  const auto held_error = [](std::string what, std::string rule) {
    return fail({ErrorKind::kBadInput, std::move(what), "spline fit", {}, std::move(rule)});
  };
  if ((first_derivative.size() > 0 && first_position.size() == 0) ||
      (last_derivative.size() > 0 && last_position.size() == 0)) {
    return held_error("an end derivative is held without its position", "hold the position too");
  }

  const int p = knots.degree();
  const int n = knots.control_point_count();
  const bool clamped_first = knots.knots().front() == knots.first();
  const bool clamped_last = knots.knots().back() == knots.last();
  if ((first_position.size() > 0 && !clamped_first) ||
      (last_position.size() > 0 && !clamped_last)) {
    return held_error("an end is held on floating knots", "held ends must be clamped");
  }
  if ((first_derivative.size() > 0 || last_derivative.size() > 0) && p < 1) {
    return held_error("an end derivative is held at degree 0", "degree must be at least 1");
  }

  // An end derivative fixes the second control point: c' = p (c1 - c0) / (u_(p+1) - u_1).
  HeldEnds held{Eigen::MatrixXd(0, dimension), Eigen::MatrixXd(0, dimension)};
  if (first_position.size() > 0) {
    held.first = first_position.transpose();
    if (first_derivative.size() > 0) {
      const double reach = (knots[p + 1] - knots[1]) / p;
      held.first.conservativeResize(2, Eigen::NoChange);
      held.first.row(1) = held.first.row(0) + reach * first_derivative.transpose();
    }
  }
  if (last_position.size() > 0) {
    const Eigen::RowVectorXd end = last_position.transpose();
    if (last_derivative.size() > 0) {
      const double reach = (knots[n + p - 1] - knots[n - 1]) / p;
      held.last.resize(2, dimension);
      held.last.row(0) = end - reach * last_derivative.transpose();
      held.last.row(1) = end;
    } else {
      held.last = end;
    }
  }

  if (held.first.rows() + held.last.rows() > n) {
    return held_error("held ends overlap", "more control points than held conditions are needed");
  }
  return held;
}

template <int D>
Eigen::MatrixXd optional_column(const std::optional<Eigen::Matrix<double, D, 1>>& value) {
  return value ? Eigen::MatrixXd(*value) : Eigen::MatrixXd(0, 0);
}

}  // namespace

CompactRows collocation_matrix(const KnotVector& knots, const std::vector<double>& parameters,
                               int derivative) {
  EXPECTS(derivative >= 0 && derivative <= KnotVector::kMaxDegree);
  const int order = knots.order();
  CompactRows A(static_cast<int>(parameters.size()), knots.control_point_count(), order);
  std::vector<double> basis(static_cast<std::size_t>(order * (derivative + 1)));
  int span = -1;
  for (int r = 0; r < A.rows(); ++r) {
    const double t = parameters[static_cast<std::size_t>(r)];
    span = knots.span(t, span);
    basis_on_span(knots, span, t, derivative, basis.data());
    A.set_row(r, span - knots.degree(), basis.data() + derivative * order, order);
  }
  return A;
}

void collocate(const KnotVector& knots, const std::vector<double>& parameters, CompactRows& into) {
  into.reshape(static_cast<int>(parameters.size()), knots.control_point_count(), knots.order());
  std::array<double, kMaxOrder> values;
  SpanBasis basis(knots);
  int span = -1;
  for (int r = 0; r < into.rows(); ++r) {
    const double t = parameters[static_cast<std::size_t>(r)];
    span = knots.span(t, span);
    basis.values(span, t, values.data());
    into.set_row(r, span - knots.degree(), values.data(), knots.order());
  }
}

std::vector<CompactRows> collocation_matrices(const KnotVector& knots,
                                              const std::vector<double>& parameters,
                                              int derivatives) {
  EXPECTS(derivatives >= 0 && derivatives <= KnotVector::kMaxDegree);
  const int order = knots.order();
  const int rows = static_cast<int>(parameters.size());
  std::vector<CompactRows> matrices(static_cast<std::size_t>(derivatives) + 1,
                                    CompactRows(rows, knots.control_point_count(), order));
  std::vector<double> basis(static_cast<std::size_t>(order * (derivatives + 1)));

  int span = -1;
  for (int r = 0; r < rows; ++r) {
    const double t = parameters[static_cast<std::size_t>(r)];
    span = knots.span(t, span);
    basis_on_span(knots, span, t, derivatives, basis.data());
    for (int d = 0; d <= derivatives; ++d) {
      matrices[static_cast<std::size_t>(d)].set_row(r, span - knots.degree(),
                                                    basis.data() + d * order, order);
    }
  }
  return matrices;
}

std::optional<Error> schoenberg_whitney_violation(const KnotVector& knots,
                                                  const std::vector<double>& parameters) {
  EXPECTS(static_cast<int>(parameters.size()) == knots.control_point_count());
  for (int i = 0; i < knots.control_point_count(); ++i) {
    const double t = parameters[static_cast<std::size_t>(i)];
    const double low = knots[i];
    const double high = knots[i + knots.order()];
    // Where a function jumps from or to a value other than zero its end of support counts, as
    // evaluation is from the right, and from the left at the end of the domain.
    const bool at_low = t == low && knots[i + knots.degree()] == low && t < knots.last();
    const bool at_high = t == high && t == knots.last() && knots[i + 1] == high;
    if ((t > low && t < high) || at_low || at_high) continue;
    return Error{ErrorKind::kBadInput,
                 "Schoenberg-Whitney condition violated: parameter " + std::to_string(i) +
                     " is outside the support of basis function " + std::to_string(i),
                 "parameter " + std::to_string(i), std::to_string(t),
                 "must be inside " + interval_text(low, high)};
  }
  return std::nullopt;
}

template <int D>
Result<BSplineCurve<D>> interpolate(const KnotVector& knots, const std::vector<double>& parameters,
                                    const Eigen::Matrix<double, D, Eigen::Dynamic>& points) {
  const std::size_t n = static_cast<std::size_t>(knots.control_point_count());
  if (parameters.size() != n) return fail(count_error(parameters.size(), n, "parameters"));
  if (points.cols() != static_cast<Eigen::Index>(n)) {
    return fail(count_error(static_cast<std::size_t>(points.cols()), n, "points"));
  }
  if (auto error = parameter_error(knots, parameters)) return fail(*error);

  for (std::size_t i = 1; i < n; ++i) {
    if (!(parameters[i] > parameters[i - 1])) {
      return fail({ErrorKind::kBadInput, "parameter does not increase",
                   "parameter " + std::to_string(i), std::to_string(parameters[i]),
                   "interpolation parameters must increase"});
    }
  }
  if (auto error = schoenberg_whitney_violation(knots, parameters)) return fail(*error);

  Eigen::MatrixXd x = points.transpose();
  const int bad = solve_totally_positive(collocation_matrix(knots, parameters), x);
  if (bad >= 0) {
    return fail({ErrorKind::kFailed, "interpolation is singular to rounding",
                 "parameter " + std::to_string(bad),
                 std::to_string(parameters[static_cast<std::size_t>(bad)]),
                 "parameters must lie well inside the supports of their basis functions"});
  }
  return BSplineCurve<D>(knots, x.transpose());
}

template <int D>
BSplineCurve<D> interpolate_at_greville(const KnotVector& knots,
                                        const Eigen::Matrix<double, D, Eigen::Dynamic>& points) {
  EXPECTS(points.cols() == knots.control_point_count());
  Eigen::MatrixXd x = points.transpose();
  EXPECTS(solve_totally_positive(collocation_matrix(knots, knots.greville()), x) < 0);
  return BSplineCurve<D>(knots, x.transpose());
}

template <int D>
BSplineSurface<D> interpolate_at_greville(const KnotVector& u, const KnotVector& v,
                                          const Eigen::Matrix<double, D, Eigen::Dynamic>& points) {
  const int m = u.control_point_count();
  const int n = v.control_point_count();
  EXPECTS(points.cols() == static_cast<Eigen::Index>(m) * n);
  const auto solve_on = [](const KnotVector& knots) {
    return [&knots](Eigen::MatrixXd x) -> Result<Eigen::MatrixXd> {
      EXPECTS(solve_totally_positive(collocation_matrix(knots, knots.greville()), x) < 0);
      return x;
    };
  };
  return BSplineSurface<D>(u, v, *tensor_fit<D>(points, m, solve_on(u), solve_on(v)));
}

template <int D>
Result<CurveFit<D>> fit_curve(const KnotVector& knots, const std::vector<double>& parameters,
                              const Eigen::Matrix<double, D, Eigen::Dynamic>& points,
                              const CurveFitOptions<D>& options) {
  const std::size_t count = parameters.size();
  if (points.cols() != static_cast<Eigen::Index>(count)) {
    return fail(count_error(static_cast<std::size_t>(points.cols()), count, "points"));
  }
  if (!options.weights.empty() && options.weights.size() != count) {
    return fail(count_error(options.weights.size(), count, "weights"));
  }
  if (auto error = parameter_error(knots, parameters)) return fail(*error);

  const Result<HeldEnds> held = held_ends(knots, optional_column<D>(options.first.position),
                                          optional_column<D>(options.first.derivative),
                                          optional_column<D>(options.last.position),
                                          optional_column<D>(options.last.derivative), D);
  if (!held) return fail(held.error());
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(points.cols());
  for (std::size_t i = 0; i < options.weights.size(); ++i) {
    weights(static_cast<Eigen::Index>(i)) = options.weights[i];
  }

  std::optional<CompactRows> gram;
  if (options.roughness > 0) gram = gram_matrix(knots, options.roughness_derivative);
  const CompactRows A = collocation_matrix(knots, parameters);
  const Result<Eigen::MatrixXd> x = least_squares(A, points.transpose(), weights, *held,
                                                  gram ? &*gram : nullptr, options.roughness);
  if (!x) return fail(x.error());

  CurveFit<D> fit{BSplineCurve<D>(knots, x->transpose()), 0, 0};
  const Eigen::Matrix<double, D, Eigen::Dynamic> residual =
      A.apply<D>(fit.curve.control_points()) - points;
  if (count > 0) {
    fit.largest_residual = residual.colwise().norm().maxCoeff();
    fit.rms_residual = std::sqrt(residual.colwise().squaredNorm().mean());
  }
  return fit;
}

Result<Eigen::MatrixXd> least_squares_rows(const KnotVector& knots,
                                           const std::vector<double>& parameters,
                                           const Eigen::MatrixXd& values) {
  if (values.rows() != static_cast<Eigen::Index>(parameters.size())) {
    return fail(count_error(static_cast<std::size_t>(values.rows()), parameters.size(), "values"));
  }
  if (auto error = parameter_error(knots, parameters)) return fail(*error);
  const HeldEnds none{Eigen::MatrixXd(0, values.cols()), Eigen::MatrixXd(0, values.cols())};
  return least_squares(collocation_matrix(knots, parameters), values,
                       Eigen::VectorXd::Ones(values.rows()), none, nullptr, 0);
}

template <int D>
Result<BSplineSurface<D>> fit_surface(const KnotVector& u, const KnotVector& v,
                                      const std::vector<double>& us, const std::vector<double>& vs,
                                      const Eigen::Matrix<double, D, Eigen::Dynamic>& points) {
  const Eigen::Index m = static_cast<Eigen::Index>(us.size());
  const Eigen::Index n = static_cast<Eigen::Index>(vs.size());
  if (points.cols() != m * n) {
    return fail(
        count_error(static_cast<std::size_t>(points.cols()), us.size() * vs.size(), "points"));
  }
  auto net = tensor_fit<D>(
      points, m, [&](const Eigen::MatrixXd& x) { return least_squares_rows(u, us, x); },
      [&](const Eigen::MatrixXd& x) { return least_squares_rows(v, vs, x); });
  if (!net) return fail(net.error());
  return BSplineSurface<D>(u, v, std::move(*net));
}

CompactRows gram_matrix(const KnotVector& knots, int derivative) {
  EXPECTS(derivative >= 0);
  const int p = knots.degree();
  const int n = knots.control_point_count();
  const int width = std::min(2 * p + 1, n);
  Eigen::MatrixXd band = Eigen::MatrixXd::Zero(2 * p + 1, n);  // column i: entries (i, i - p + k)

  // Span by span with a rule that is exact for the product of two pieces (degree 2 (p -
  // derivative)).
  if (derivative <= p) {
    const GaussRule rule = gauss_legendre(p - derivative + 1);
    std::vector<double> basis(static_cast<std::size_t>((derivative + 1) * (p + 1)));
    for (int span = p; span < n; ++span) {
      const double half = 0.5 * (knots[span + 1] - knots[span]);
      if (!(half > 0)) continue;
      for (Eigen::Index q = 0; q < rule.nodes.size(); ++q) {
        const double t = knots[span] + half * (1 + rule.nodes(q));
        basis_on_span(knots, span, t, derivative, basis.data());
        const double* row = basis.data() + derivative * (p + 1);
        for (int i = 0; i <= p; ++i) {
          for (int j = 0; j <= p; ++j) {
            band(p + j - i, span - p + i) += half * rule.weights(q) * row[i] * row[j];
          }
        }
      }
    }
  }

  CompactRows gram(n, n, width);
  for (int i = 0; i < n; ++i) {
    // Entries beyond the matrix are zero, so a run of `width` that covers the rest loses nothing.
    const int start = std::clamp(i - p, 0, n - width);
    std::array<double, 2 * kMaxOrder> run{};
    for (int k = 0; k < width; ++k) {
      const int offset = start + k - i + p;
      run[static_cast<std::size_t>(k)] = offset >= 0 && offset <= 2 * p ? band(offset, i) : 0.0;
    }
    gram.set_row(i, start, run.data(), width);
  }
  return gram;
}

#define ANGIOSPLINE_INSTANTIATE(D)                                                               \
  template Result<BSplineCurve<D>> interpolate(const KnotVector&, const std::vector<double>&,    \
                                               const Eigen::Matrix<double, D, Eigen::Dynamic>&); \
  template BSplineCurve<D> interpolate_at_greville(                                              \
      const KnotVector&, const Eigen::Matrix<double, D, Eigen::Dynamic>&);                       \
  template BSplineSurface<D> interpolate_at_greville(                                            \
      const KnotVector&, const KnotVector&, const Eigen::Matrix<double, D, Eigen::Dynamic>&);    \
  template Result<CurveFit<D>> fit_curve(const KnotVector&, const std::vector<double>&,          \
                                         const Eigen::Matrix<double, D, Eigen::Dynamic>&,        \
                                         const CurveFitOptions<D>&);                             \
  template Result<BSplineSurface<D>> fit_surface(                                                \
      const KnotVector&, const KnotVector&, const std::vector<double>&,                          \
      const std::vector<double>&, const Eigen::Matrix<double, D, Eigen::Dynamic>&);
ANGIOSPLINE_INSTANTIATE(1)
ANGIOSPLINE_INSTANTIATE(2)
ANGIOSPLINE_INSTANTIATE(3)
ANGIOSPLINE_INSTANTIATE(4)
#undef ANGIOSPLINE_INSTANTIATE

}  // namespace angiospline
