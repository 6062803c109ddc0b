// Steps of a net under its continuity equations.
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "modeling/junction/patch_solver.h"
#include "modeling/junction/quality.h"
#include "modeling/junction/smooth_junction.h"
#include "modeling/junction/target_energy.h"
#include "tests/modeling/junction/sample_junction.h"

namespace angiospline {
namespace {

// Quadratic, and with a positive definite Hessian: the layout's nodes and even nets.
constexpr EnergyWeights kQuadratic{0, 0, 1, 0.01, 1};

Eigen::VectorXd gradient(const std::vector<PatchModel>& models, int unknowns) {
  Eigen::VectorXd g = Eigen::VectorXd::Zero(unknowns);
  for (const PatchModel& m : models) {
    for (std::size_t k = 0; k < m.unknowns.size(); ++k) {
      g(m.unknowns[k]) += m.gradient(static_cast<Eigen::Index>(k));
    }
  }
  return g;
}

TEST(PatchSolver, FindsTheMinimumOfAQuadraticInOneFreeStep) {
  const SampleJunction j = sample_junction(four_spec());
  JunctionNet net = start_net(j.topology, j.layout);
  TargetEnergy energy(j.topology, nullptr, j.layout, net);
  PatchSolver solver(net, smooth_edges(j.topology, j.layout, net, {}), energy.models(),
                     {1e-12, 100});
  const double before = gradient(energy.updated(net, kQuadratic), net.unknowns).norm();
  EXPECT_GT(solver.free_step(energy.updated(net, kQuadratic)), 0);
  const double after = gradient(energy.updated(net, kQuadratic), net.unknowns).norm();
  EXPECT_LT(after, 1e-9 * before);
  EXPECT_LT(solver.free_step(energy.updated(net, kQuadratic)), 1e-8);
}

TEST(PatchSolver, CutsALongStepToItsLength) {
  const SampleJunction j = sample_junction(y_spec());
  JunctionNet net = start_net(j.topology, j.layout);
  TargetEnergy energy(j.topology, nullptr, j.layout, net);
  PatchSolver solver(net, smooth_edges(j.topology, j.layout, net, {}), energy.models(),
                     {1e-12, 0.01});
  const Points3 before = net.points;
  const double wanted = solver.free_step(energy.updated(net, kQuadratic));
  ASSERT_GT(wanted, 0.01);
  double farthest = 0;
  for (std::size_t k = 0; k < net.scale.size(); ++k) {
    const auto c = static_cast<Eigen::Index>(k);
    farthest = std::max(farthest, (net.points.col(c) - before.col(c)).norm() / net.scale[k]);
  }
  EXPECT_NEAR(farthest, 0.01, 1e-9);
}

TEST(PatchSolver, PolishesQuadraticallyToRounding) {
  const SampleJunction j = sample_junction(y_spec());
  SmoothingWeights weights;
  weights.constrained.most_polish = 0;
  SmoothedNet coarse = smooth_junction(j.topology, j.target, j.layout, weights);
  ASSERT_TRUE(coarse.solved);
  TargetEnergy energy(j.topology, &j.target, j.layout, coarse.net);
  PatchSolver solver(coarse.net, smooth_edges(j.topology, j.layout, coarse.net, {}),
                     energy.models(), {});
  ASSERT_GE(solver.constrained_step(energy.updated(coarse.net, {})), 0);
  double residual = solver.residual();
  for (int k = 0; k < 6 && residual > 1e-12; ++k) {
    ASSERT_GE(solver.polish_step(), 0);
    const double now = solver.residual();
    // Newton's method: the square of what was left, but for rounding.
    EXPECT_LT(now, 100 * residual * residual + 1e-12);
    residual = now;
  }
  EXPECT_LT(residual, 1e-12);
  EXPECT_LT(junction_quality(j.topology, j.target, coarse.net).worst_angle_deg, 1e-6);
}

TEST(PatchSolver, MovesNothingWhereAnEnergyIsNoNumber) {
  const SampleJunction j = sample_junction(y_spec());
  JunctionNet net = start_net(j.topology, j.layout);
  TargetEnergy energy(j.topology, nullptr, j.layout, net);
  PatchSolver solver(net, smooth_edges(j.topology, j.layout, net, {}), energy.models(), {});
  std::vector<PatchModel> models = energy.updated(net, kQuadratic);
  models.front().gradient(0) = std::numeric_limits<double>::quiet_NaN();
  const Points3 before = net.points;
  EXPECT_EQ(solver.free_step(models), -1);
  EXPECT_EQ(solver.constrained_step(models), -1);
  EXPECT_EQ(net.points, before);
}

TEST(SmoothInPlace, LeavesASmoothJunctionWhereItIs) {
  const SampleJunction j = sample_junction(y_spec());
  const SmoothedNet smooth = smooth_junction(j.topology, j.target, j.layout);
  ASSERT_TRUE(smooth.solved);
  EXPECT_LT(smooth.residual, 1e-12);
  JunctionLayout layout = j.layout;
  // Its own surface is what it is to keep to.
  const int last = layout.grid.size() - 1;
  for (int p = 0; p < static_cast<int>(j.topology.patches.size()); ++p) {
    const PatchNet P = patch_net(smooth.net, p);
    for (int a = 0; a <= last; ++a) {
      for (int b = 0; b <= last; ++b) {
        const PatchBasis f =
            patch_basis({static_cast<double>(a) / last, static_cast<double>(b) / last});
        layout.nodes.col(layout.grid.at(p, a, b)) = P * f.value;
      }
    }
  }
  const SmoothedNet again = smooth_in_place(j.topology, layout, smooth.net);
  EXPECT_TRUE(again.solved);
  EXPECT_LT((again.net.points - smooth.net.points).colwise().norm().maxCoeff(), 0.02);
  EXPECT_LT(again.residual, 1e-12);
}

}  // namespace
}  // namespace angiospline
