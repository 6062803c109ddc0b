#include "kernel/fit/penalised_curve.h"

#include <algorithm>
#include <array>

#include "base/contract.h"
#include "kernel/numerics/banded.h"
#include "kernel/spline/basis.h"

namespace angiospline {
namespace {

// Four Gauss points on [-1, 1] integrate the square of a second derivative of degree 3 exactly.
// They are rounded to 15 digits, as they were when results were first recorded.
constexpr std::array<double, 4> kGaussPoints{-0.861136311594053, -0.339981043584856,
                                             0.339981043584856, 0.861136311594053};
constexpr std::array<double, 4> kGaussWeights{0.347854845137454, 0.652145154862546,
                                              0.652145154862546, 0.347854845137454};

// Adds weight * b b' at the rows and columns first, first + 1, ...
void add_product(BandedCholesky& A, int first, const Eigen::RowVectorXd& b, double weight) {
  for (int i = 0; i < b.size(); ++i) {
    for (int j = 0; j <= i; ++j) A.at(first + i, first + j) += weight * b(i) * b(j);
  }
}

// Adds the integrals of `bending` times products of second derivatives of the basis.
void add_bending(BandedCholesky& A, const KnotVector& knots, const std::vector<double>& bending) {
  const std::vector<double> breaks = knots.breakpoints();
  EXPECTS(bending.size() + 1 == breaks.size());
  for (std::size_t s = 0; s + 1 < breaks.size(); ++s) {
    const double half = (breaks[s + 1] - breaks[s]) / 2;
    for (std::size_t g = 0; g < kGaussPoints.size(); ++g) {
      const BasisValues b = basis_at(knots, breaks[s] + half * (1 + kGaussPoints[g]), 2);
      add_product(A, b.first, b.values.row(2), bending[s] * half * kGaussWeights[g]);
    }
  }
}

}  // namespace

Eigen::MatrixXd fit_spline(const KnotVector& knots, const SplineFitProblem& problem) {
  const int n = knots.control_point_count();
  const int first = static_cast<int>(problem.first.rows());
  const int last = static_cast<int>(problem.last.rows());
  const Eigen::Index dimension = problem.values.cols();
  EXPECTS(first + last <= n);
  EXPECTS(first == 0 || problem.first.cols() == dimension);
  EXPECTS(last == 0 || problem.last.cols() == dimension);
  EXPECTS(static_cast<Eigen::Index>(problem.parameters.size()) == problem.values.rows());
  EXPECTS(problem.weights.empty() || problem.weights.size() == problem.parameters.size());

  // The normal equations A c = b of all control points: A = B' W B + bending, b = B' W Y.
  BandedCholesky A(n, knots.order());
  Eigen::MatrixXd b = Eigen::MatrixXd::Zero(n, dimension);
  int span = -1;
  for (std::size_t i = 0; i < problem.parameters.size(); ++i) {
    const BasisValues basis = basis_at(knots, problem.parameters[i], 0, span);
    span = basis.first + knots.degree();
    const double weight = problem.weights.empty() ? 1.0 : problem.weights[i];
    add_product(A, basis.first, basis.values.row(0), weight);
    b.middleRows(basis.first, knots.order()) +=
        weight * basis.values.row(0).transpose() * problem.values.row(static_cast<Eigen::Index>(i));
  }
  if (!problem.bending.empty()) add_bending(A, knots, problem.bending);

  Eigen::MatrixXd control = Eigen::MatrixXd::Zero(n, dimension);
  if (first > 0) control.topRows(first) = problem.first;
  if (last > 0) control.bottomRows(last) = problem.last;
  const int free = n - first - last;
  if (free == 0) return control;

  // Held rows leave the system: their columns go to the right-hand side.
  BandedCholesky reduced(free, knots.order());
  Eigen::MatrixXd x = b.middleRows(first, free);
  double largest = 0;
  for (int i = 0; i < n; ++i) {
    for (int j = std::max(0, i - knots.degree()); j <= i; ++j) {
      const bool i_free = i >= first && i < first + free;
      const bool j_free = j >= first && j < first + free;
      if (i_free && j_free) reduced.at(i - first, j - first) = A.at(i, j);
      if (i_free && !j_free) x.row(i - first) -= A.at(i, j) * control.row(j);
      if (!i_free && j_free) x.row(j - first) -= A.at(i, j) * control.row(i);
    }
    largest = std::max(largest, A.at(i, i));
  }

  reduced.factor_with_ridge(1e-12 * largest);
  reduced.solve(x);
  control.middleRows(first, free) = x;
  return control;
}

}  // namespace angiospline
