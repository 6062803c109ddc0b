// Compact rows against the dense matrix they stand for.
#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

#include "base/random.h"
#include "kernel/numerics/compact_rows.h"

namespace angiospline {
namespace {

// Random runs, some of them beyond the border, some with zeros at their ends.
CompactRows random_rows(Random& random, int rows, int columns, int width) {
  CompactRows A(rows, columns, width);
  std::vector<double> run(static_cast<std::size_t>(width));
  for (int r = 0; r < rows; ++r) {
    for (double& x : run) x = random.below(4) == 0 ? 0 : random.gaussian();
    A.set_row(r, random.below(columns + width - 1) - width + 1, run.data(), width);
  }
  return A;
}

TEST(CompactRows, DropsWhatIsBeyondTheMatrix) {
  CompactRows A(3, 4, 3);
  const double run[] = {1, 2, 3};
  A.set_row(0, -2, run, 3);
  A.set_row(1, 3, run, 3);
  A.set_row(2, 1, run, 2);
  Eigen::MatrixXd expected(3, 4);
  expected << 3, 0, 0, 0,  //
      0, 0, 0, 1,          //
      0, 1, 2, 0;
  EXPECT_EQ(A.to_dense(), expected);
  EXPECT_EQ(Eigen::MatrixXd(A.to_sparse()), expected);
}

TEST(CompactRows, AppliesLikeTheDenseMatrixToPointsAndToBlocksOfAnyLength) {
  Random random(1);
  for (int round = 0; round < 60; ++round) {
    const int columns = 1 + random.below(12);
    const int width = 1 + random.below(std::min(columns, 7));
    const CompactRows A = random_rows(random, 1 + random.below(20), columns, width);
    for (const int stride : {1, 2, 3, 4, 7, 8, 19}) {
      Eigen::MatrixXd blocks(stride, columns);  // a column is a block
      for (double& x : blocks.reshaped()) x = random.gaussian();
      const Eigen::MatrixXd expected = blocks * A.to_dense().transpose();
      Eigen::MatrixXd out(stride, A.rows());
      A.apply_blocks(blocks.data(), stride, out.data());
      EXPECT_LT((out - expected).norm(), 1e-13 * (1 + expected.norm()));

      Eigen::VectorXd row(stride);
      const int r = random.below(A.rows());
      A.apply_row(r, blocks.data(), stride, row.data());
      EXPECT_LT((row - expected.col(r)).norm(), 1e-13 * (1 + expected.norm()));
    }
    const Eigen::Matrix3Xd points = Eigen::Matrix3Xd::Ones(3, columns);
    EXPECT_LT((A.apply<3>(points) - points * A.to_dense().transpose()).norm(), 1e-12);
  }
}

TEST(CompactRows, TakesAnotherShapeInTheSameMemory) {
  CompactRows A(9, 8, 5);
  A.reshape(2, 3, 1);
  const double one = 1;
  A.set_row(0, 2, &one, 1);
  A.set_row(1, 0, &one, 1);
  EXPECT_EQ(A.rows(), 2);
  EXPECT_EQ(A.columns(), 3);
  EXPECT_EQ(A.to_dense(), (Eigen::MatrixXd(2, 3) << 0, 0, 1, 1, 0, 0).finished());
}

}  // namespace
}  // namespace angiospline
