#include "kernel/numerics/spectrum.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "base/random.h"

namespace angiospline {
namespace {

Eigen::MatrixXd random_matrix(Eigen::Index rows, Eigen::Index columns, std::uint64_t seed) {
  Random random(seed);
  Eigen::MatrixXd A(rows, columns);
  for (Eigen::Index k = 0; k < A.size(); ++k) A.data()[k] = random.gaussian();
  return A;
}

double from_orthonormal(const Eigen::MatrixXd& Q) {
  return (Q.transpose() * Q - Eigen::MatrixXd::Identity(Q.cols(), Q.cols())).norm();
}

TEST(SingularValues, MultiplyBackToTheMatrixWhicheverSideIsLonger) {
  for (const auto& [rows, columns] : {std::pair{7, 4}, {4, 7}, {40, 33}, {33, 40}, {1, 1}}) {
    const Eigen::MatrixXd A = random_matrix(rows, columns, 5);
    const auto [U, values, V] = singular_values(A, SingularVectors::kThin);
    const Eigen::Index least = std::min(A.rows(), A.cols());
    ASSERT_EQ(U.cols(), least);
    ASSERT_EQ(V.cols(), least);
    EXPECT_LT((U * values.asDiagonal() * V.transpose() - A).norm(), 1e-13 * A.norm());
    EXPECT_LT(from_orthonormal(U), 1e-12);
    EXPECT_LT(from_orthonormal(V), 1e-12);
    for (Eigen::Index k = 0; k + 1 < values.size(); ++k) EXPECT_GE(values[k], values[k + 1]);
  }
}

TEST(SingularValues, OfAKnownRankVanishBeyondIt) {
  const Eigen::MatrixXd A = random_matrix(30, 3, 1) * random_matrix(3, 25, 2);
  const auto thin = singular_values(A, SingularVectors::kThinLeft);
  EXPECT_GT(thin.values[2], 1.0);
  EXPECT_LT(thin.values.tail(22).maxCoeff(), 1e-12 * thin.values[0]);
  EXPECT_EQ(thin.U.cols(), 25);
  EXPECT_EQ(thin.V.size(), 0);
  // The full left side spans what the columns of A do not reach.
  const auto full = singular_values(A, SingularVectors::kFullLeft);
  ASSERT_EQ(full.U.cols(), 30);
  EXPECT_LT((full.U.rightCols(27).transpose() * A).norm(), 1e-12 * A.norm());
  EXPECT_LT(from_orthonormal(full.U), 1e-12);
}

TEST(SymmetricEigenvalues, OfAChainOfSpringsAreTheOnesInClosedForm) {
  // 2 on the diagonal, -1 beside it: 4 sin^2(k pi / 2(n + 1)).
  const int n = 25;
  Eigen::MatrixXd A = 2 * Eigen::MatrixXd::Identity(n, n);
  for (int k = 0; k + 1 < n; ++k) A(k + 1, k) = -1;  // the upper triangle is not read
  const Eigen::VectorXd values = symmetric_eigenvalues(A);
  for (int k = 1; k <= n; ++k) {
    const double s = std::sin(k * std::numbers::pi / (2 * (n + 1)));
    EXPECT_NEAR(values[k - 1], 4 * s * s, 1e-13);
  }
}

}  // namespace
}  // namespace angiospline
