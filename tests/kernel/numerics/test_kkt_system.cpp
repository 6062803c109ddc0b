// Constrained least squares steps against a dense solver.
#include <algorithm>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "base/random.h"
#include "kernel/numerics/kkt_system.h"

namespace angiospline {
namespace {

struct Dense {
  Eigen::MatrixXd H, J;

  Eigen::MatrixXd matrix(double epsilon) const {
    const Eigen::Index n = H.rows(), m = J.rows();
    Eigen::MatrixXd A(n + m, n + m);
    A << H, J.transpose(), J, -epsilon * Eigen::MatrixXd::Identity(m, m);
    return A;
  }
};

TEST(KktSystem, SolvesWhatItsEntriesAddUpTo) {
  Random random(1);
  for (const int n : {4, 20, 90}) {
    const int m = n / 4;
    std::vector<KktSystem::Place> hessian, jacobian;
    for (int i = 0; i < n; ++i) {
      for (const int j : {i, std::max(0, i - 2), std::max(0, i - 1)}) hessian.emplace_back(i, j);
    }
    for (int e = 0; e < m; ++e) {
      for (int k = 0; k < 4; ++k) jacobian.emplace_back(e, random.below(n));  // some twice
    }
    KktSystem system(n, m, hessian, jacobian);
    for (int round = 0; round < 2; ++round) {  // the second with other values
      Dense dense{Eigen::MatrixXd::Zero(n, n), Eigen::MatrixXd::Zero(m, n)};
      system.clear();
      for (std::size_t k = 0; k < hessian.size(); ++k) {
        const auto [i, j] = hessian[k];
        const double value = random.uniform(-1, 1);
        system.add_hessian(k, value);
        dense.H(i, j) += value;
        if (i != j) dense.H(j, i) += value;
      }
      for (int i = 0; i < n; ++i) {
        system.add_diagonal(i, 10);
        dense.H(i, i) += 10;
      }
      for (std::size_t k = 0; k < jacobian.size(); ++k) {
        const double value = random.gaussian();
        system.add_jacobian(k, value);
        dense.J(jacobian[k].first, jacobian[k].second) += value;
      }
      ASSERT_TRUE(system.factor(1e-3));
      Eigen::VectorXd right(n + m);
      for (double& r : right) r = random.gaussian();
      const Eigen::VectorXd expected = dense.matrix(1e-3).fullPivLu().solve(right);
      EXPECT_LT((system.solve(right) - expected).norm(), 1e-9 * (1 + expected.norm()));
    }
  }
}

TEST(KktSystem, ClearingTheJacobianLeavesTheHessian) {
  KktSystem system(2, 1, {{0, 0}, {1, 1}}, {{0, 0}, {0, 1}});
  system.clear();
  system.add_hessian(0, 2);
  system.add_hessian(1, 4);
  system.add_jacobian(0, 5);
  system.clear_jacobian();
  system.add_jacobian(1, 1);
  ASSERT_TRUE(system.factor(1));
  // 2 x0 = 2; 4 x1 + y = 4; x1 - y = 1.
  const Eigen::VectorXd x = system.solve(Eigen::Vector3d(2, 4, 1));
  EXPECT_LT((x - Eigen::Vector3d(1, 1, 0)).norm(), 1e-14);
}

TEST(KktSystem, AnEmptyHessianIsSaidToVanish) {
  KktSystem system(2, 0, {{1, 0}}, {});
  system.clear();
  EXPECT_FALSE(system.factor(1));
}

}  // namespace
}  // namespace angiospline
