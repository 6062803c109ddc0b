// Sparse factors against dense ones: definite, quasi-definite, disconnected, refactored, refused.
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include "base/random.h"
#include "kernel/numerics/frontal_factor.h"

namespace angiospline {
namespace {

using Sparse = Eigen::SparseMatrix<double>;

Sparse lower_of(const Eigen::MatrixXd& A) {
  Sparse lower = Eigen::MatrixXd(A.triangularView<Eigen::Lower>()).sparseView();
  lower.makeCompressed();
  return lower;
}

Eigen::VectorXd gaussian(Random& random, Eigen::Index size) {
  Eigen::VectorXd x(size);
  for (double& v : x) v = random.gaussian();
  return x;
}

// A random sparse symmetric pattern, made definite by its diagonal.
Eigen::MatrixXd random_definite(Random& random, int size, double entries_a_row) {
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(size, size);
  for (int k = 0; k < static_cast<int>(entries_a_row * size); ++k) {
    const int i = random.below(size), j = random.below(size);
    if (i != j) A(i, j) = A(j, i) = random.uniform(-1, 1);
  }
  A.diagonal() = (A.cwiseAbs().rowwise().sum().array() + 0.1).matrix().eval();
  return A;
}

// [H J'; J -D] with H and D definite.
Eigen::MatrixXd quasi_definite(Random& random, int unknowns, int equations) {
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(unknowns + equations, unknowns + equations);
  A.topLeftCorner(unknowns, unknowns) = random_definite(random, unknowns, 2);
  for (int e = 0; e < equations; ++e) {
    for (int k = 0; k < 3; ++k) {
      const int column = random.below(unknowns);
      A(unknowns + e, column) = A(column, unknowns + e) = random.gaussian();
    }
    A(unknowns + e, unknowns + e) = -0.01;
  }
  return A;
}

void expect_solution(const FrontalFactor& factor, const Eigen::MatrixXd& A, Random& random) {
  const Eigen::VectorXd right = gaussian(random, A.rows());
  const Eigen::VectorXd x = factor.solve(right);
  EXPECT_LT((A * x - right).norm(), 1e-10 * (A.norm() * x.norm() + right.norm()));
  EXPECT_LT((x - A.ldlt().solve(right)).norm(), 1e-7 * (1 + x.norm()));
}

TEST(FrontalFactor, SolvesDefiniteSystemsOfEveryDensityLikeADenseFactor) {
  Random random(1);
  for (const int size : {1, 2, 3, 10, 80, 250}) {
    for (const double entries : {0.0, 0.7, 2.0, 8.0}) {
      const Eigen::MatrixXd A = random_definite(random, size, entries);
      const Sparse lower = lower_of(A);
      FrontalFactor factor(lower);
      ASSERT_TRUE(factor.factor(lower));
      expect_solution(factor, A, random);
    }
  }
}

TEST(FrontalFactor, SolvesQuasiDefiniteSystemsWhosePivotsHaveBothSigns) {
  Random random(2);
  for (const int unknowns : {3, 30, 200}) {
    const Eigen::MatrixXd A = quasi_definite(random, unknowns, unknowns / 3);
    const Eigen::VectorXd eigenvalues = A.selfadjointView<Eigen::Lower>().eigenvalues();
    ASSERT_LT(eigenvalues(0), 0);
    ASSERT_GT(eigenvalues(A.rows() - 1), 0);
    const Sparse lower = lower_of(A);
    FrontalFactor factor(lower);
    ASSERT_TRUE(factor.factor(lower));
    expect_solution(factor, A, random);
  }
}

TEST(FrontalFactor, OfAFullMatrixIsOneFront) {
  Random random(3);
  for (const int size : {31, 32, 33, 100}) {  // about the block size
    Eigen::MatrixXd B(size, size);
    for (double& b : B.reshaped()) b = random.gaussian();
    const Eigen::MatrixXd A = B * B.transpose() + Eigen::MatrixXd::Identity(size, size);
    const Sparse lower = lower_of(A);
    FrontalFactor factor(lower);
    ASSERT_TRUE(factor.factor(lower));
    expect_solution(factor, A, random);
  }
}

TEST(FrontalFactor, OnAGridHasLongChainsOfFrontsAndSolvesIt) {
  const int side = 25;
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(side * side, side * side);
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const int at = y * side + x;
      if (x + 1 < side) K(at, at + 1) = K(at + 1, at) = -1;
      if (y + 1 < side) K(at, at + side) = K(at + side, at) = -1;
    }
  }
  K.diagonal() = -K.rowwise().sum();
  const Eigen::MatrixXd A = Eigen::MatrixXd::Identity(side * side, side * side) + 50 * K * K;
  const Sparse lower = lower_of(A);
  FrontalFactor factor(lower);
  ASSERT_TRUE(factor.factor(lower));
  Random random(4);
  expect_solution(factor, A, random);
}

TEST(FrontalFactor, FactorsOtherValuesOfTheSamePatternAsIfItHadNeverSeenOthers) {
  Random random(5);
  const Eigen::MatrixXd first = quasi_definite(random, 60, 20);
  Sparse lower = lower_of(first);
  FrontalFactor again(lower);
  ASSERT_TRUE(again.factor(lower));
  for (double& v : lower.coeffs()) v *= random.uniform(0.9, 1.1);
  ASSERT_TRUE(again.factor(lower));
  FrontalFactor fresh(lower);
  ASSERT_TRUE(fresh.factor(lower));
  const Eigen::VectorXd right = gaussian(random, lower.rows());
  EXPECT_EQ(again.solve(right), fresh.solve(right));
}

TEST(FrontalFactor, AVanishedOrInfinitePivotIsSaidAndSoundValuesWorkAfterwards) {
  Random random(6);
  const Eigen::MatrixXd A = random_definite(random, 40, 2);
  Sparse lower = lower_of(A);
  const Sparse sound = lower;
  FrontalFactor factor(lower);
  lower.coeffs().setZero();
  EXPECT_FALSE(factor.factor(lower));
  lower = sound;
  lower.coeffRef(17, 17) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(factor.factor(lower));
  ASSERT_TRUE(factor.factor(sound));
  expect_solution(factor, A, random);
}

}  // namespace
}  // namespace angiospline
