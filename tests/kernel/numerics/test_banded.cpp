// Banded factors against dense ones, and the two right-hand-side layouts against each other.
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <gtest/gtest.h>

#include "base/random.h"
#include "kernel/fit/fit.h"
#include "kernel/numerics/banded.h"
#include "tests/shapes/random_splines.h"

namespace angiospline {
namespace {

// A = B B' + I / 10 with B of half the band: positive definite, of this width.
Eigen::MatrixXd definite(Random& random, int size, int width) {
  Eigen::MatrixXd B = Eigen::MatrixXd::Zero(size, size);
  for (int i = 0; i < size; ++i) {
    for (int j = std::max(0, i - width + 1); j <= i; ++j) B(i, j) = random.gaussian();
  }
  return B * B.transpose() + 0.1 * Eigen::MatrixXd::Identity(size, size);
}

BandedCholesky banded(const Eigen::MatrixXd& A, int width) {
  BandedCholesky N(static_cast<int>(A.rows()), width);
  for (int i = 0; i < N.size(); ++i) {
    for (int j = std::max(0, i - width + 1); j <= i; ++j) N.at(i, j) = A(i, j);
  }
  return N;
}

Eigen::MatrixXd gaussian(Random& random, Eigen::Index rows, Eigen::Index columns) {
  Eigen::MatrixXd X(rows, columns);
  for (double& x : X.reshaped()) x = random.gaussian();
  return X;
}

TEST(BandedCholesky, SolvesLikeADenseSolver) {
  Random random(1);
  for (const int size : {1, 2, 5, 40}) {
    for (const int width : {1, 2, 4, 7}) {
      const Eigen::MatrixXd A = definite(random, size, width);
      BandedCholesky N = banded(A, width);
      ASSERT_EQ(N.factor(), -1);
      const Eigen::MatrixXd X = gaussian(random, size, 3);
      Eigen::MatrixXd solved = A * X;
      N.solve(solved);
      EXPECT_LT((solved - X).norm(), 1e-9 * X.norm() * A.norm()) << size << ' ' << width;
    }
  }
}

TEST(BandedCholesky, SolvesBlocksToTheSameBitsAsColumns) {
  Random random(2);
  BandedCholesky N = banded(definite(random, 30, 4), 4);
  ASSERT_EQ(N.factor(), -1);
  Eigen::MatrixXd columns = gaussian(random, 30, 5);
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> blocks = columns;
  N.solve(columns);
  N.solve_blocks(blocks.data(), 5);
  EXPECT_EQ(columns, Eigen::MatrixXd(blocks));
}

TEST(BandedCholesky, NamesTheFirstRowWithoutAPositivePivot) {
  BandedCholesky N(4, 2);
  for (int i = 0; i < 4; ++i) N.at(i, i) = 1;
  N.at(2, 1) = 1;  // rows 1 and 2 are the same
  EXPECT_EQ(N.factor(), 2);
}

TEST(BandedCholesky, GramMatrixIsThatOfTheDenseRows) {
  Random random(3);
  const KnotVector knots = random_knots(random, 4);
  std::vector<double> parameters;
  for (int i = 0; i < 30; ++i) parameters.push_back(random_parameter(random, knots));
  const CompactRows A = collocation_matrix(knots, parameters);
  const Eigen::VectorXd weights = gaussian(random, 30, 1).cwiseAbs();
  const Eigen::MatrixXd dense = A.to_dense().transpose() * weights.asDiagonal() * A.to_dense();
  BandedCholesky N = BandedCholesky::gram(A, weights);
  for (int i = 0; i < N.size(); ++i) {
    for (int j = std::max(0, i - A.width() + 1); j <= i; ++j) {
      EXPECT_NEAR(N.at(i, j), dense(i, j), 1e-12 * (1 + dense.norm()));
    }
  }
}

TEST(BandedCholesky, ARidgeIsAddedToTheDiagonal) {
  Random random(4);
  const Eigen::MatrixXd A = definite(random, 20, 3);
  BandedCholesky with_ridge = banded(A, 3);
  with_ridge.factor_with_ridge(0.5);
  BandedCholesky added = banded(A + 0.5 * Eigen::MatrixXd::Identity(20, 20), 3);
  ASSERT_EQ(added.factor(), -1);
  for (int i = 0; i < 20; ++i) {
    for (int j = std::max(0, i - 2); j <= i; ++j) EXPECT_EQ(with_ridge.at(i, j), added.at(i, j));
  }
}

TEST(BandedCholesky, WithARidgeASingularMatrixKeepsWhatIsUndeterminedSmall) {
  BandedCholesky N(3, 2);  // nothing is known of the last unknown
  N.at(0, 0) = N.at(1, 1) = 1;
  N.factor_with_ridge(1e-12);
  Eigen::MatrixXd x = Eigen::Vector3d(2, 3, 0);
  N.solve(x);
  EXPECT_NEAR(x(0), 2, 1e-11);
  EXPECT_NEAR(x(1), 3, 1e-11);
  EXPECT_EQ(x(2), 0);
}

TEST(SymmetricBand, FactorsAndSolvesLikeADenseSolver) {
  Random random(5);
  for (const int size : {1, 4, 40}) {
    for (const int width : {1, 3, 6}) {
      const Eigen::MatrixXd A = definite(random, size, width);
      SymmetricBand L = SymmetricBand::Zero(width, size);
      for (int j = 0; j < size; ++j) {
        for (int k = 0; k < width && j + k < size; ++k) L(k, j) = A(j + k, j);
      }
      ASSERT_TRUE(factorise_band(L));
      const Eigen::MatrixXd X = gaussian(random, size, 2);
      Eigen::MatrixXd solved = A * X;
      solve_band(L, solved);
      EXPECT_LT((solved - X).norm(), 1e-9 * X.norm() * A.norm()) << size << ' ' << width;
    }
  }
}

TEST(SymmetricBand, AnIndefiniteMatrixIsRefused) {
  SymmetricBand A(2, 2);
  A << 1, 1, 2, 0;  // [1 2; 2 1]
  EXPECT_FALSE(factorise_band(A));
}

TEST(CyclicCholesky, SolvesLikeADenseSolverOnLongAndShortCircles) {
  Random random(6);
  for (const int size : {3, 6, 7, 40}) {
    const int width = 3;
    Eigen::MatrixXd A = 10 * Eigen::MatrixXd::Identity(size, size);
    CyclicCholesky N(size, width);
    for (int i = 0; i < size; ++i) N.add(i, i, 10);
    for (int i = 0; i < size; ++i) {
      for (int d = 1; d < width && 2 * d < size; ++d) {
        const int j = (i + d) % size;
        const double value = random.uniform(-1, 1);
        N.add(i, j, value);
        A(i, j) += value;
        A(j, i) += value;
      }
    }
    ASSERT_TRUE(N.factor()) << size;
    const Eigen::MatrixXd X = gaussian(random, size, 2);
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> solved = A * X;
    N.solve_blocks(solved.data(), 2);
    EXPECT_LT((Eigen::MatrixXd(solved) - X).norm(), 1e-12 * (1 + X.norm())) << size;
  }
}

TEST(CyclicCholesky, AnIndefiniteMatrixIsRefused) {
  CyclicCholesky N(9, 2);
  for (int i = 0; i < 9; ++i) N.add(i, i, i == 4 ? -1 : 1);
  EXPECT_FALSE(N.factor());
}

TEST(SolveTotallyPositive, AgreesWithPivotedEliminationOnCollocationMatrices) {
  Random random(7);
  for (int round = 0; round < 40; ++round) {
    const KnotVector knots = random_knots(random, 1 + random.below(6), 1, false);
    const CompactRows A = collocation_matrix(knots, knots.greville());
    const Eigen::MatrixXd X = gaussian(random, A.columns(), 2);
    const Eigen::MatrixXd right = A.to_dense() * X;
    Eigen::MatrixXd solved = right;
    ASSERT_EQ(solve_totally_positive(A, solved), -1);
    EXPECT_LT((A.to_dense() * solved - right).norm(), 1e-12 * (1 + right.norm()));
  }
}

TEST(SolveTotallyPositive, NamesTheRowThatNoBasisFunctionReaches) {
  const KnotVector knots = KnotVector::clamped(2, {0, 1, 2, 3, 4, 5, 6});
  std::vector<double> parameters = knots.greville();
  parameters[0] = 5.5;  // outside the support of function 0 by more than the band
  Eigen::MatrixXd x = Eigen::MatrixXd::Ones(knots.control_point_count(), 1);
  EXPECT_EQ(solve_totally_positive(collocation_matrix(knots, parameters), x), 0);
}

}  // namespace
}  // namespace angiospline
