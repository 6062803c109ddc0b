#include "kernel/fit/penalised_curve.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/contract.h"
#include "kernel/spline/basis.h"

namespace angiospline {
namespace {

// A symmetric positive matrix of small bandwidth: row i holds columns i - width .. i.
class BandMatrix {
 public:
  BandMatrix(Eigen::Index size, Eigen::Index width)
      : width_(width), rows_(Eigen::MatrixXd::Zero(width + 1, size)) {}

  double& at(Eigen::Index row, Eigen::Index column) { return rows_(column - row + width_, row); }
  double at(Eigen::Index row, Eigen::Index column) const {
    return rows_(column - row + width_, row);
  }
  Eigen::Index size() const { return rows_.cols(); }
  Eigen::Index first_column(Eigen::Index row) const {
    return std::max<Eigen::Index>(0, row - width_);
  }

  // A = L L' in place; `ridge` is added to the diagonal.
  void factorise(double ridge) {
    for (Eigen::Index i = 0; i < size(); ++i) {
      for (Eigen::Index j = first_column(i); j <= i; ++j) {
        double sum = at(i, j) + (i == j ? ridge : 0.0);
        for (Eigen::Index k = std::max(first_column(i), first_column(j)); k < j; ++k) {
          sum -= at(i, k) * at(j, k);
        }
        at(i, j) = i == j ? std::sqrt(std::max(sum, ridge)) : sum / at(j, j);
      }
    }
  }

  // Solves L L' x = b in place, one right-hand side a column.
  void solve(Eigen::MatrixXd& b) const {
    for (Eigen::Index i = 0; i < size(); ++i) {
      for (Eigen::Index j = first_column(i); j < i; ++j) b.row(i) -= at(i, j) * b.row(j);
      b.row(i) /= at(i, i);
    }
    for (Eigen::Index i = size() - 1; i >= 0; --i) {
      b.row(i) /= at(i, i);
      for (Eigen::Index j = first_column(i); j < i; ++j) b.row(j) -= at(i, j) * b.row(i);
    }
  }

 private:
  Eigen::Index width_;
  Eigen::MatrixXd rows_;
};

// Four Gauss points integrate the square of a second derivative of degree 3 exactly.
constexpr std::array<double, 4> kGaussPoints{-0.861136311594053, -0.339981043584856,
                                             0.339981043584856, 0.861136311594053};
constexpr std::array<double, 4> kGaussWeights{0.347854845137454, 0.652145154862546,
                                              0.652145154862546, 0.347854845137454};

void add_product(BandMatrix& A, int first, const Eigen::RowVectorXd& b, double weight) {
  for (Eigen::Index i = 0; i < b.size(); ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) A.at(first + i, first + j) += weight * b(i) * b(j);
  }
}

void add_bending(BandMatrix& A, const KnotVector& knots, const std::vector<double>& bending) {
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
  const Eigen::Index n = knots.control_point_count();
  const Eigen::Index first = problem.first.rows();
  const Eigen::Index last = problem.last.rows();
  const Eigen::Index dimension = problem.values.cols();
  EXPECTS(first + last <= n);
  EXPECTS(first == 0 || problem.first.cols() == dimension);
  EXPECTS(last == 0 || problem.last.cols() == dimension);
  EXPECTS(static_cast<Eigen::Index>(problem.parameters.size()) == problem.values.rows());
  EXPECTS(problem.weights.empty() || problem.weights.size() == problem.parameters.size());

  BandMatrix A(n, knots.degree());
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

  // Held rows leave the system: their columns go to the right-hand side.
  Eigen::MatrixXd held = Eigen::MatrixXd::Zero(n, dimension);
  if (first > 0) held.topRows(first) = problem.first;
  if (last > 0) held.bottomRows(last) = problem.last;
  const Eigen::Index free = n - first - last;
  BandMatrix reduced(free, knots.degree());
  Eigen::MatrixXd x = b.middleRows(first, free);
  double largest = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = A.first_column(i); j <= i; ++j) {
      const bool i_free = i >= first && i < first + free;
      const bool j_free = j >= first && j < first + free;
      if (i_free && j_free) reduced.at(i - first, j - first) = A.at(i, j);
      if (i_free && !j_free) x.row(i - first) -= A.at(i, j) * held.row(j);
      if (!i_free && j_free) x.row(j - first) -= A.at(i, j) * held.row(i);
    }
    largest = std::max(largest, A.at(i, i));
  }
  reduced.factorise(1e-12 * largest);
  reduced.solve(x);
  held.middleRows(first, free) = x;
  return held;
}

}  // namespace angiospline
