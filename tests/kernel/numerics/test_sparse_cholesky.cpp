#include "kernel/numerics/sparse_cholesky.h"

#include <vector>

#include <gtest/gtest.h>

#include "base/random.h"

namespace angiospline {
namespace {

// The graph Laplacian of a chain of nodes, each held to the ground by `ground`.
Eigen::SparseMatrix<double> held_chain(int nodes, double ground) {
  std::vector<Eigen::Triplet<double>> entries;
  for (int k = 0; k < nodes; ++k) {
    entries.emplace_back(k, k, ground + (k > 0) + (k + 1 < nodes));
    if (k > 0) entries.emplace_back(k, k - 1, -1.0), entries.emplace_back(k - 1, k, -1.0);
  }
  Eigen::SparseMatrix<double> A(nodes, nodes);
  A.setFromTriplets(entries.begin(), entries.end());
  return A;
}

TEST(SparseCholesky, SolvesForEachRightSideByItself) {
  const Eigen::SparseMatrix<double> A = held_chain(60, 0.01);
  Random random(3);
  Eigen::MatrixXd x(60, 4);
  for (Eigen::Index k = 0; k < x.size(); ++k) x.data()[k] = random.gaussian();
  const SparseCholesky factors(A);
  ASSERT_TRUE(factors.is_positive_definite());
  const Eigen::MatrixXd b = A * x;
  const Eigen::MatrixXd solved = factors.solve(b);
  EXPECT_LT((solved - x).norm(), 1e-10 * x.norm());
  for (Eigen::Index k = 0; k < 4; ++k) EXPECT_EQ(factors.solve(b.col(k)), solved.col(k));
}

TEST(SparseCholesky, TellsWhatIsNotPositiveDefinite) {
  EXPECT_TRUE(SparseCholesky(held_chain(10, 1e-6)).is_positive_definite());
  EXPECT_FALSE(SparseCholesky(held_chain(10, -0.5)).is_positive_definite());
  EXPECT_FALSE(SparseCholesky(Eigen::SparseMatrix<double>(3, 3)).is_positive_definite());
}

TEST(SparseCholesky, StaysTheSameWhenItIsMoved) {
  SparseCholesky first(held_chain(12, 1.0));
  const Eigen::VectorXd b = Eigen::VectorXd::Ones(12);
  const Eigen::MatrixXd before = first.solve(b);
  SparseCholesky second = std::move(first);
  EXPECT_EQ(second.solve(b), before);
  // A chain on the ground of stiffness 1 under a load of 1 moves by 1 as a whole.
  EXPECT_LT((before - b).norm(), 1e-14);
}

}  // namespace
}  // namespace angiospline
