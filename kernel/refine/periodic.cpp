#include "kernel/refine/periodic.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

#include "base/contract.h"
#include "kernel/fit/fit.h"
#include "kernel/fit/tensor_fit.h"
#include "kernel/refine/refinement.h"
#include "kernel/refine/reshape.h"

namespace angiospline {
namespace {

tl::unexpected<Error> refuse(std::string what, std::string value, std::string rule) {
  return fail({ErrorKind::kBadInput, std::move(what), "periodic spline", std::move(value),
               std::move(rule)});
}

}  // namespace

// With t(0) .. t(N - 1) the knots of one period and t(i + N) = t(i) + period, the flat vector runs
// from t(r - degree), r the last copy of the start, to the same place behind the first copy of the
// end.
Result<KnotVector> periodic_knots(int degree, const std::vector<Knot>& knots, double end) {
  if (knots.empty()) return refuse("no knots", "0", "at least one knot a period is needed");
  if (degree < 1) return refuse("degree is too low", std::to_string(degree), "at least 1");
  std::vector<double> period;
  for (const Knot& knot : knots) {
    if (knot.multiplicity < 1 || knot.multiplicity > degree) {
      return refuse("multiplicity breaks the curve", std::to_string(knot.multiplicity),
                    "multiplicities are 1 to the degree");
    }
    if (!(knot.value < end)) {
      return refuse("knot is not before the end of the period", std::to_string(knot.value),
                    "must be below " + std::to_string(end));
    }
    period.insert(period.end(), static_cast<std::size_t>(knot.multiplicity), knot.value);
  }

  // Knot i for any i: the period's, moved by whole periods; the first one of the next period is
  // `end` itself, unrounded.
  const int N = static_cast<int>(period.size());
  const double length = end - period.front();
  const auto at = [&](int i) {
    const int turns = i >= 0 ? i / N : -((N - 1 - i) / N);
    const double t = period[static_cast<std::size_t>(i - turns * N)];
    return turns == 1 && t == period.front() ? end : t + turns * length;
  };

  // Flat knots begin so that the first knot of the domain is the last copy of the period's first.
  const int r = knots.front().multiplicity - 1;
  std::vector<double> flat;
  for (int i = r - degree; i <= N + degree; ++i) flat.push_back(at(i));
  return KnotVector::make(degree, std::move(flat));
}

std::optional<int> periodic_count(const KnotVector& knots) {
  const int p = knots.degree();
  const int n = knots.control_point_count();
  int start = p;  // the first copy of the start of the domain at or before index p
  while (start > 0 && knots[start - 1] == knots.first()) --start;
  int end = n;
  while (end > 0 && knots[end - 1] == knots.last()) --end;
  const int N = end - start;
  const int total = static_cast<int>(knots.knots().size());
  if (p < 1 || N < 1 || n - N < 1) return std::nullopt;
  const double period = knots.last() - knots.first();
  const double rounding = 16 * std::numeric_limits<double>::epsilon() *
                          (std::abs(knots.knots().front()) + std::abs(knots.knots().back()));
  for (int i = 0; i + N < total; ++i) {
    if (std::abs(knots[i + N] - knots[i] - period) > rounding) return std::nullopt;
  }
  return N;
}

Result<KnotVector> with_knots_periodic(const KnotVector& knots, std::vector<double> added) {
  EXPECTS(periodic_count(knots).has_value());
  for (double& t : added) {
    if (t == knots.last()) t = knots.first();
  }
  const Result<KnotVector> merged = with_knots(knots, std::move(added));
  if (!merged) return fail(merged.error());
  std::vector<Knot> period;
  for (const Knot& knot : distinct_knots(*merged)) {
    if (knot.value >= knots.first() && knot.value < knots.last()) period.push_back(knot);
  }
  return periodic_knots(knots.degree(), period, knots.last());
}

template <int D>
BSplineCurve<D> periodic_curve(const KnotVector& knots,
                               const Eigen::Matrix<double, D, Eigen::Dynamic>& distinct) {
  const std::optional<int> N = periodic_count(knots);
  EXPECTS(N && distinct.cols() == *N);
  typename BSplineCurve<D>::ControlPoints points(D, knots.control_point_count());
  for (int i = 0; i < points.cols(); ++i) points.col(i) = distinct.col(i % *N);
  return BSplineCurve<D>(knots, std::move(points));
}

template <int D>
bool is_periodic(const BSplineCurve<D>& curve) {
  const std::optional<int> N = periodic_count(curve.knots());
  if (!N) return false;
  const Eigen::Index copies = curve.control_points().cols() - *N;
  return curve.control_points().rightCols(copies) == curve.control_points().leftCols(copies);
}

template <int D>
BSplineSurface<D> periodic_surface(const KnotVector& u, const KnotVector& v,
                                   const Eigen::Matrix<double, D, Eigen::Dynamic>& distinct) {
  const int m = periodic_count(u).value_or(u.control_point_count());
  const int n = periodic_count(v).value_or(v.control_point_count());
  EXPECTS(distinct.cols() == static_cast<Eigen::Index>(m) * n);
  typename BSplineSurface<D>::ControlPoints net(
      D, static_cast<Eigen::Index>(u.control_point_count()) * v.control_point_count());
  Eigen::Index column = 0;
  for (int i = 0; i < u.control_point_count(); ++i) {
    for (int j = 0; j < v.control_point_count(); ++j) {
      net.col(column++) = distinct.col(static_cast<Eigen::Index>(i % m) * n + j % n);
    }
  }
  return BSplineSurface<D>(u, v, std::move(net));
}

template <int D>
bool is_periodic_u(const BSplineSurface<D>& surface) {
  const std::optional<int> N = periodic_count(surface.u());
  if (!N) return false;
  const Eigen::Index copies = surface.index(surface.u_count() - *N, 0);
  return surface.control_points().rightCols(copies) == surface.control_points().leftCols(copies);
}

template <int D>
bool is_periodic_v(const BSplineSurface<D>& surface) {
  const std::optional<int> N = periodic_count(surface.v());
  if (!N) return false;
  for (int i = 0; i < surface.u_count(); ++i) {
    for (int j = *N; j < surface.v_count(); ++j) {
      if (surface.control_point(i, j) != surface.control_point(i, j - *N)) return false;
    }
  }
  return true;
}

template <int D>
BSplineCurve<D> closed_up(const BSplineCurve<D>& curve) {
  const std::optional<int> N = periodic_count(curve.knots());
  EXPECTS(N.has_value());
  typename BSplineCurve<D>::ControlPoints points = curve.control_points();
  for (Eigen::Index i = *N; i < points.cols(); ++i) points.col(i) = points.col(i - *N);
  return BSplineCurve<D>(curve.knots(), std::move(points));
}

template <int D>
BSplineSurface<D> closed_up_u(const BSplineSurface<D>& surface) {
  const std::optional<int> N = periodic_count(surface.u());
  EXPECTS(N.has_value());
  typename BSplineSurface<D>::ControlPoints net = surface.control_points();
  const Eigen::Index period = surface.index(*N, 0);
  for (Eigen::Index k = period; k < net.cols(); ++k) net.col(k) = net.col(k - period);
  return BSplineSurface<D>(surface.u(), surface.v(), std::move(net));
}

template <int D>
BSplineSurface<D> closed_up_v(const BSplineSurface<D>& surface) {
  const std::optional<int> N = periodic_count(surface.v());
  EXPECTS(N.has_value());
  typename BSplineSurface<D>::ControlPoints net = surface.control_points();
  for (int i = 0; i < surface.u_count(); ++i) {
    for (int j = *N; j < surface.v_count(); ++j) {
      net.col(surface.index(i, j)) = net.col(surface.index(i, j - *N));
    }
  }
  return BSplineSurface<D>(surface.u(), surface.v(), std::move(net));
}

template <int D>
Result<BSplineCurve<D>> insert_knots_periodic(const BSplineCurve<D>& curve,
                                              std::vector<double> added) {
  EXPECTS(is_periodic(curve));
  const Result<KnotVector> knots = with_knots_periodic(curve.knots(), std::move(added));
  if (!knots) return fail(knots.error());
  return closed_up(rewrite(curve, *knots));
}

// Equal blocks are combined by the same sums, so a closed other direction stays so to the bit.
template <int D>
Result<BSplineSurface<D>> insert_knots_periodic_u(const BSplineSurface<D>& surface,
                                                  std::vector<double> added) {
  EXPECTS(is_periodic_u(surface));
  const Result<KnotVector> u = with_knots_periodic(surface.u(), std::move(added));
  if (!u) return fail(u.error());
  return closed_up_u(transform_u(surface, rewriting_matrix(surface.u(), *u), *u));
}

template <int D>
Result<BSplineSurface<D>> insert_knots_periodic_v(const BSplineSurface<D>& surface,
                                                  std::vector<double> added) {
  EXPECTS(is_periodic_v(surface));
  const Result<KnotVector> v = with_knots_periodic(surface.v(), std::move(added));
  if (!v) return fail(v.error());
  return closed_up_v(transform_v(surface, rewriting_matrix(surface.v(), *v), *v));
}

// The control points of a period are the same ones whatever knot it starts at: they are turned
// round, and the knots with them.
template <int D>
BSplineCurve<D> with_seam(const BSplineCurve<D>& curve, double start) {
  EXPECTS(is_periodic(curve));
  const double first = curve.knots().first();
  const double last = curve.knots().last();
  EXPECTS(start >= first && start <= last);
  if (start == first || start == last) return over(curve, start, start + (last - first));

  std::vector<double> added;
  if (curve.knots().multiplicity(start) == 0) added.push_back(start);
  const Result<BSplineCurve<D>> fine = insert_knots_periodic(curve, added);
  EXPECTS(fine.has_value());

  // The knots from `start` on come first; those before it follow one period later.
  std::vector<Knot> before;
  std::vector<Knot> period;
  int turned = 0;  // control points whose knots move to the end
  for (const Knot& knot : distinct_knots(fine->knots())) {
    if (knot.value < first || knot.value >= last) continue;
    if (knot.value >= start) {
      period.push_back(knot);
    } else {
      before.push_back({knot.value + (last - first), knot.multiplicity});
      turned += knot.multiplicity;
    }
  }

  const int old_copies = fine->knots().multiplicity(first);
  const int new_copies = period.front().multiplicity;
  period.insert(period.end(), before.begin(), before.end());
  const Result<KnotVector> knots =
      periodic_knots(curve.knots().degree(), period, start + (last - first));
  EXPECTS(knots.has_value());

  const int N = *periodic_count(*knots);
  // Control point 0 goes with the knot that many places before the last copy of the start.
  const int shift = turned + new_copies - old_copies;
  typename BSplineCurve<D>::ControlPoints distinct(D, N);
  for (int i = 0; i < N; ++i) distinct.col(i) = fine->control_points().col((i + shift + N) % N);
  return periodic_curve<D>(*knots, distinct);
}

namespace {

// The least-squares control points over knots that repeat, one row each; values have one row for
// each parameter.
Result<Eigen::MatrixXd> solve_closed(const KnotVector& knots, const std::vector<double>& parameters,
                                     const Eigen::MatrixXd& values) {
  const int N = *periodic_count(knots);
  for (const double t : parameters) {
    if (!(t >= knots.first() && t <= knots.last())) {
      return refuse("parameter is outside the domain", std::to_string(t),
                    "must be in [" + std::to_string(knots.first()) + ", " +
                        std::to_string(knots.last()) + "]");
    }
  }

  // Columns wrap: function j of the flat knots is function j mod N of the period.
  const CompactRows flat = collocation_matrix(knots, parameters);
  std::vector<Eigen::Triplet<double>> entries;
  for (int r = 0; r < flat.rows(); ++r) {
    for (int k = 0; k < flat.width(); ++k) {
      entries.emplace_back(r, (flat.first(r) + k) % N, flat.row(r)[k]);
    }
  }
  Eigen::SparseMatrix<double> A(flat.rows(), N);
  A.setFromTriplets(entries.begin(), entries.end());

  // Normal equations, corrected once on the residual: what squaring the condition costs comes back
  // (Bjorck, Numerical Methods for Least Squares Problems, 1996).
  const Eigen::SparseMatrix<double> normal = A.transpose() * A;
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor(normal);
  const double largest = normal.diagonal().maxCoeff();
  constexpr double kSingular = 1e-13;
  if (factor.info() != Eigen::Success || !(factor.vectorD().minCoeff() > kSingular * largest)) {
    return refuse("points do not determine the closed spline", std::to_string(parameters.size()),
                  "the points must satisfy the Schoenberg-Whitney conditions around the period");
  }

  Eigen::MatrixXd x = Eigen::MatrixXd::Zero(N, values.cols());
  for (int pass = 0; pass < 2; ++pass) {  // the solution, then its correction
    const Eigen::MatrixXd rest = values - A * x;
    x += factor.solve(A.transpose() * rest);
  }
  return x;
}

// One direction of a surface: closed or clamped, as its knots say.
CurveSolve solve_direction(const KnotVector& knots, const std::vector<double>& parameters) {
  return [&](const Eigen::MatrixXd& values) {
    return periodic_count(knots) ? solve_closed(knots, parameters, values)
                                 : least_squares_rows(knots, parameters, values);
  };
}

tl::unexpected<Error> wrong_count(Eigen::Index got, std::size_t wanted) {
  return refuse("wrong number of points", std::to_string(got),
                std::to_string(wanted) + " are needed");
}

}  // namespace

template <int D>
Result<BSplineCurve<D>> fit_periodic(const KnotVector& knots, const std::vector<double>& parameters,
                                     const Eigen::Matrix<double, D, Eigen::Dynamic>& points) {
  if (!periodic_count(knots)) {
    return refuse("knots do not repeat", {}, "make them with periodic_knots");
  }
  if (static_cast<std::size_t>(points.cols()) != parameters.size()) {
    return wrong_count(points.cols(), parameters.size());
  }
  const Result<Eigen::MatrixXd> x = solve_closed(knots, parameters, points.transpose());
  if (!x) return fail(x.error());
  return periodic_curve<D>(knots, x->transpose());
}

template <int D>
Result<BSplineSurface<D>> fit_periodic(const KnotVector& u, const KnotVector& v,
                                       const std::vector<double>& us, const std::vector<double>& vs,
                                       const Eigen::Matrix<double, D, Eigen::Dynamic>& points) {
  if (!periodic_count(u) && !periodic_count(v)) {
    return refuse("knots repeat in neither direction", {}, "make them with periodic_knots");
  }
  const Eigen::Index m = static_cast<Eigen::Index>(us.size());
  const Eigen::Index n = static_cast<Eigen::Index>(vs.size());
  if (points.cols() != m * n) return wrong_count(points.cols(), us.size() * vs.size());
  const auto distinct = tensor_fit<D>(points, m, solve_direction(u, us), solve_direction(v, vs));
  if (!distinct) return fail(distinct.error());
  return periodic_surface<D>(u, v, *distinct);
}

#define ANGIOSPLINE_INSTANTIATE(D)                                                              \
  template BSplineSurface<D> periodic_surface(const KnotVector&, const KnotVector&,             \
                                              const Eigen::Matrix<double, D, Eigen::Dynamic>&); \
  template bool is_periodic_u(const BSplineSurface<D>&);                                        \
  template bool is_periodic_v(const BSplineSurface<D>&);                                        \
  template BSplineSurface<D> closed_up_u(const BSplineSurface<D>&);                             \
  template BSplineSurface<D> closed_up_v(const BSplineSurface<D>&);                             \
  template Result<BSplineSurface<D>> insert_knots_periodic_u(const BSplineSurface<D>&,          \
                                                             std::vector<double>);              \
  template Result<BSplineSurface<D>> insert_knots_periodic_v(const BSplineSurface<D>&,          \
                                                             std::vector<double>);              \
  template Result<BSplineSurface<D>> fit_periodic(                                              \
      const KnotVector&, const KnotVector&, const std::vector<double>&,                         \
      const std::vector<double>&, const Eigen::Matrix<double, D, Eigen::Dynamic>&);             \
  template BSplineCurve<D> periodic_curve(const KnotVector&,                                    \
                                          const Eigen::Matrix<double, D, Eigen::Dynamic>&);     \
  template bool is_periodic(const BSplineCurve<D>&);                                            \
  template BSplineCurve<D> closed_up(const BSplineCurve<D>&);                                   \
  template BSplineCurve<D> with_seam(const BSplineCurve<D>&, double);                           \
  template Result<BSplineCurve<D>> insert_knots_periodic(const BSplineCurve<D>&,                \
                                                         std::vector<double>);                  \
  template Result<BSplineCurve<D>> fit_periodic(const KnotVector&, const std::vector<double>&,  \
                                                const Eigen::Matrix<double, D, Eigen::Dynamic>&);
ANGIOSPLINE_INSTANTIATE(1)
ANGIOSPLINE_INSTANTIATE(2)
ANGIOSPLINE_INSTANTIATE(3)
ANGIOSPLINE_INSTANTIATE(4)
#undef ANGIOSPLINE_INSTANTIATE

}  // namespace angiospline
