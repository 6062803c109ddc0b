#include <gtest/gtest.h>

#include "base/random.h"
#include "kernel/fit/tensor_fit.h"

namespace angiospline {
namespace {

TEST(TensorFit, AppliesOneMatrixAlongUAndAnotherAlongV) {
  Random random(1);
  const int m = 5, n = 4;
  const Eigen::MatrixXd U = Eigen::MatrixXd::Random(3, m), V = Eigen::MatrixXd::Random(6, n);
  Eigen::Matrix2Xd points(2, m * n);
  for (double& x : points.reshaped()) x = random.gaussian();
  const auto by = [](const Eigen::MatrixXd& A) {
    return [&A](const Eigen::MatrixXd& x) -> Result<Eigen::MatrixXd> {
      return Eigen::MatrixXd(A * x);
    };
  };
  const auto net = tensor_fit<2>(points, m, by(U), by(V));
  ASSERT_TRUE(net);
  ASSERT_EQ(net->cols(), 3 * 6);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 6; ++j) {
      Eigen::Vector2d sum = Eigen::Vector2d::Zero();
      for (int k = 0; k < m; ++k) {
        for (int l = 0; l < n; ++l) sum += U(i, k) * V(j, l) * points.col(k * n + l);
      }
      EXPECT_LT((net->col(i * 6 + j) - sum).norm(), 1e-13);
    }
  }
}

TEST(TensorFit, SaysInWhichDirectionASolverFailed) {
  const Eigen::Matrix2Xd points = Eigen::Matrix2Xd::Ones(2, 6);
  const auto keep = [](const Eigen::MatrixXd& x) -> Result<Eigen::MatrixXd> { return x; };
  const auto refuse = [](const Eigen::MatrixXd&) -> Result<Eigen::MatrixXd> {
    return fail({ErrorKind::kBadInput, "no", "here", {}, {}});
  };
  EXPECT_EQ(tensor_fit<2>(points, 3, refuse, keep).error().where, "u direction, here");
  EXPECT_EQ(tensor_fit<2>(points, 3, keep, refuse).error().where, "v direction, here");
}

}  // namespace
}  // namespace angiospline
