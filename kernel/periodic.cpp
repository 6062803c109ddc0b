#include "kernel/periodic.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

#include "base/contract.h"
#include "kernel/fit.h"
#include "kernel/refinement.h"

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
  const int N = static_cast<int>(period.size());
  const double length = end - period.front();
  const auto at = [&](int i) {
    const int turns = i >= 0 ? i / N : -((N - 1 - i) / N);
    const double t = period[static_cast<std::size_t>(i - turns * N)];
    return turns == 1 && t == period.front() ? end : t + turns * length;
  };
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
  return copies >= 1 &&
         curve.control_points().rightCols(copies) == curve.control_points().leftCols(copies);
}

template <int D>
Result<BSplineCurve<D>> insert_knots_periodic(const BSplineCurve<D>& curve,
                                              std::vector<double> added) {
  EXPECTS(is_periodic(curve));
  const KnotVector& old = curve.knots();
  for (double& t : added) {
    if (t == old.last()) t = old.first();
  }
  const Result<KnotVector> merged = with_knots(old, std::move(added));
  if (!merged) return fail(merged.error());
  std::vector<Knot> period;
  for (const Knot& knot : distinct_knots(*merged)) {
    if (knot.value >= old.first() && knot.value < old.last()) period.push_back(knot);
  }
  const Result<KnotVector> knots = periodic_knots(old.degree(), period, old.last());
  if (!knots) return fail(knots.error());
  const BSplineCurve<D> fine = rewrite(curve, *knots);
  return periodic_curve<D>(*knots, fine.control_points().leftCols(*periodic_count(*knots)));
}

template <int D>
Result<BSplineCurve<D>> fit_periodic(const KnotVector& knots, const std::vector<double>& parameters,
                                     const Eigen::Matrix<double, D, Eigen::Dynamic>& points) {
  const std::optional<int> N = periodic_count(knots);
  if (!N) return refuse("knots do not repeat", {}, "make them with periodic_knots");
  if (static_cast<std::size_t>(points.cols()) != parameters.size()) {
    return refuse("wrong number of points", std::to_string(points.cols()),
                  std::to_string(parameters.size()) + " are needed");
  }
  for (const double t : parameters) {
    if (!(t >= knots.first() && t <= knots.last())) {
      return refuse("parameter is outside the domain", std::to_string(t),
                    "must be in [" + std::to_string(knots.first()) + ", " +
                        std::to_string(knots.last()) + "]");
    }
  }
  const CompactRows flat = collocation_matrix(knots, parameters);
  std::vector<Eigen::Triplet<double>> entries;
  for (int r = 0; r < flat.rows(); ++r) {
    for (int k = 0; k < flat.width(); ++k) {
      entries.emplace_back(r, (flat.first(r) + k) % *N, flat.row(r)[k]);
    }
  }
  Eigen::SparseMatrix<double> A(flat.rows(), *N);
  A.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SparseMatrix<double> normal = A.transpose() * A;
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor(normal);
  const double largest = normal.diagonal().maxCoeff();
  constexpr double kSingular = 1e-13;
  if (factor.info() != Eigen::Success || !(factor.vectorD().minCoeff() > kSingular * largest)) {
    return refuse("points do not determine the closed curve", std::to_string(points.cols()),
                  "the points must satisfy the Schoenberg-Whitney conditions around the period");
  }
  Eigen::MatrixXd x = Eigen::MatrixXd::Zero(*N, D);
  for (int pass = 0; pass < 2; ++pass) {  // the solution, then its correction
    const Eigen::MatrixXd rest = points.transpose() - A * x;
    x += factor.solve(A.transpose() * rest);
  }
  return periodic_curve<D>(knots, x.transpose());
}

#define ANGIOSPLINE_INSTANTIATE(D)                                                             \
  template BSplineCurve<D> periodic_curve(const KnotVector&,                                   \
                                          const Eigen::Matrix<double, D, Eigen::Dynamic>&);    \
  template bool is_periodic(const BSplineCurve<D>&);                                           \
  template Result<BSplineCurve<D>> insert_knots_periodic(const BSplineCurve<D>&,               \
                                                         std::vector<double>);                 \
  template Result<BSplineCurve<D>> fit_periodic(const KnotVector&, const std::vector<double>&, \
                                                const Eigen::Matrix<double, D, Eigen::Dynamic>&);
ANGIOSPLINE_INSTANTIATE(1)
ANGIOSPLINE_INSTANTIATE(2)
ANGIOSPLINE_INSTANTIATE(3)
ANGIOSPLINE_INSTANTIATE(4)
#undef ANGIOSPLINE_INSTANTIATE

}  // namespace angiospline
