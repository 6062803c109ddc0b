// The parts a junction is made of, each by its own laws.
#include <cmath>
#include <numbers>
#include <set>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "base/random.h"
#include "kernel/numerics/frontal_factor.h"
#include "modeling/junction/tangent_plane_rows.h"
#include "modeling/layout/opening_arcs.h"
#include "modeling/layout/target.h"
#include "modeling/layout/topology.h"

namespace angiospline {
namespace {

std::vector<Vec3> random_directions(int count, Random& random) {
  std::vector<Vec3> d;
  while (static_cast<int>(d.size()) < count) {
    const Vec3 v = Vec3(random.gaussian(), random.gaussian(), random.gaussian()).normalized();
    bool apart = true;
    for (const Vec3& other : d) apart = apart && v.dot(other) < std::cos(0.5);
    if (apart) d.push_back(v);
  }
  return d;
}

TEST(OpeningArcs, OfTwoHalvesAreACircleToTwoMillionths) {
  for (const QuinticArc& arc : opening_arcs({0.3, 0.3 + std::numbers::pi})) {
    EXPECT_LT(largest_radial_error(arc), 2e-6);
  }
}

TEST(OpeningArcs, MeetWithEqualDerivativesWhateverTheirAngles) {
  Random random(3);
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<double> seams{0.0};
    const int count = 3 + random.below(4);
    for (int k = 1; k < count; ++k) {
      seams.push_back(seams.back() + 2 * std::numbers::pi / count * random.uniform(0.6, 1.2));
    }
    const std::vector<QuinticArc> arcs = opening_arcs(seams);
    for (std::size_t k = 0; k < arcs.size(); ++k) {
      const QuinticArc& next = arcs[(k + 1) % arcs.size()];
      EXPECT_EQ(arcs[k].col(5), next.col(0));
      EXPECT_LT(((arcs[k].col(5) - arcs[k].col(4)) - (next.col(1) - next.col(0))).norm(), 1e-12);
      EXPECT_LT(largest_radial_error(arcs[k]), 0.01);
    }
  }
}

TEST(JunctionTopology, ObeysEulerAndPairsEverySide) {
  Random random(11);
  for (int trial = 0; trial < 40; ++trial) {
    const int n = 3 + trial % 8;
    const JunctionTopology t = junction_topology(random_directions(n, random), 0.09);
    // Branches, saddles and poles are the vertices, edges and faces of a polyhedron.
    EXPECT_EQ(n - static_cast<int>(t.saddles.size()) + static_cast<int>(t.poles.size()), 2);
    EXPECT_EQ(t.patches.size(), 2 * t.saddles.size());
    for (const JunctionSaddle& s : t.saddles) {
      const JunctionPatch& a = t.patches[static_cast<std::size_t>(s.patch_a)];
      const JunctionPatch& b = t.patches[static_cast<std::size_t>(s.patch_b)];
      EXPECT_EQ(a.from, b.to);
      EXPECT_EQ(a.to, b.from);
      EXPECT_EQ(a.branch, s.branch_a);
      EXPECT_EQ(b.branch, s.branch_b);
    }
    for (const JunctionPatch& p : t.patches) {
      EXPECT_EQ(t.patches[static_cast<std::size_t>(p.next)].from, p.to);
      EXPECT_EQ(t.patches[static_cast<std::size_t>(p.next)].branch, p.branch);
    }
  }
}

TEST(JunctionTopology, OfAPlaneFanHasTwoPoles) {
  const JunctionTopology t = junction_topology({{1, 0, 0},
                                                {std::sqrt(0.5), std::sqrt(0.5), 0},
                                                {std::sqrt(0.5), -std::sqrt(0.5), 0},
                                                {0, 1, 0}},
                                               0.09);
  EXPECT_EQ(t.poles.size(), 2u);
  EXPECT_EQ(t.saddles.size(), 4u);
}

TEST(SharedGrid, NumbersEveryNodeOnceAndSharesEdges) {
  Random random(5);
  const JunctionTopology t = junction_topology(random_directions(6, random), 0.09);
  const SharedGrid grid(t, 6);
  std::set<int> seen;
  for (int p = 0; p < static_cast<int>(t.patches.size()); ++p) {
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) seen.insert(grid.at(p, i, j));
      EXPECT_EQ(grid.at(p, i, 5), grid.at(t.patches[static_cast<std::size_t>(p)].next, i, 0));
    }
  }
  EXPECT_EQ(static_cast<int>(seen.size()), grid.count());
  EXPECT_EQ(*seen.rbegin(), grid.count() - 1);
  for (const JunctionSaddle& s : t.saddles) {
    for (int j = 0; j < 6; ++j) EXPECT_EQ(grid.at(s.patch_a, 5, j), grid.at(s.patch_b, 5, 5 - j));
  }
}

TEST(JunctionTarget, HasTheGradientOfItsValue) {
  Random random(9);
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<TargetBranch> branches;
    for (const Vec3& d : random_directions(3 + trial % 4, random)) {
      branches.push_back({d, random.uniform(0.2, 1.0)});
    }
    const JunctionTarget target(branches, 0.15, 0.09);
    for (int k = 0; k < 20; ++k) {
      const Vec3 x(random.uniform(-2, 2), random.uniform(-2, 2), random.uniform(-2, 2));
      const JunctionTarget::Value v = target.at(x);
      Vec3 difference;
      for (int d = 0; d < 3; ++d) {
        const Vec3 h = 1e-6 * Vec3::Unit(d);
        difference(d) = (target.at(x + h).value - target.at(x - h).value) / 2e-6;
      }
      EXPECT_LT((difference - v.gradient).norm(), 1e-6 * (1 + v.gradient.norm()));
    }
  }
}

TEST(JunctionTarget, WithCoresHasTheGradientOfItsValueAndHoldsTheCoresInside) {
  Random random(10);
  for (int trial = 0; trial < 10; ++trial) {
    std::vector<TargetBranch> branches;
    const Vec3 place(random.uniform(0.5, 1.5), 0, 0);
    for (const Vec3& d : random_directions(4, random)) {
      const bool right = d.x() > 0;
      branches.push_back({d, random.uniform(0.4, 1.0), right ? place : Vec3::Zero(), 0.0});
    }
    branches[0].start = place;
    const JunctionTarget target(branches, 0.15, 0.09);
    EXPECT_EQ(target.branches().size(), 5u);
    EXPECT_LT(target.at(0.5 * place).value, 0);
    for (int k = 0; k < 20; ++k) {
      const Vec3 x(random.uniform(-2, 2), random.uniform(-2, 2), random.uniform(-2, 2));
      const JunctionTarget::Value v = target.at(x);
      Vec3 difference;
      for (int d = 0; d < 3; ++d) {
        const Vec3 h = 1e-6 * Vec3::Unit(d);
        difference(d) = (target.at(x + h).value - target.at(x - h).value) / 2e-6;
      }
      EXPECT_LT((difference - v.gradient).norm(), 1e-6 * (1 + v.gradient.norm()));
      const Vec3 on = target.on_ray(x.normalized(), 20);
      if (on.norm() < 19) {
        EXPECT_LT(std::abs(target.foot(on).distance), 1e-4);
      }
    }
  }
}

TEST(FrontalFactor, SolvesQuasiDefiniteSystemsLikeADenseSolver) {
  Random random(4);
  for (const int size : {1, 7, 60, 400}) {
    // Blocks of overlapping rows, as patches that share edges give them, and equations on some.
    const int equations = size / 3;
    Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(size + equations, size + equations);
    for (int first = 0; first < size; first += 5) {
      const int count = std::min(12, size - first);
      Eigen::MatrixXd A(count, count);
      for (double& a : A.reshaped()) a = random.gaussian();
      dense.block(first, first, count, count) += A * A.transpose();
      dense.block(first, first, count, count).diagonal().array() += 0.1;
    }
    for (int e = 0; e < equations; ++e) {
      dense(size + e, size + e) = -1e-3;
      for (int k = 0; k < 4; ++k) dense(size + e, random.below(size)) = random.gaussian();
    }
    dense.triangularView<Eigen::StrictlyUpper>() = dense.transpose();
    Eigen::SparseMatrix<double> lower = dense.sparseView();
    lower = Eigen::SparseMatrix<double>(lower.triangularView<Eigen::Lower>());
    lower.makeCompressed();
    FrontalFactor factor(lower);
    for (const double scale : {1.0, 3.0}) {
      lower.coeffs() *= scale;
      dense *= scale;
      ASSERT_TRUE(factor.factor(lower));
      Eigen::VectorXd x(size + equations);
      for (double& v : x) v = random.gaussian();
      const Eigen::VectorXd right = dense * x;
      EXPECT_LT((factor.solve(right) - x).norm(), 1e-7 * x.norm()) << size;
    }
    lower.coeffs().setZero();
    EXPECT_FALSE(factor.factor(lower));
  }
}

TEST(JunctionTarget, OfAStraightTrunkIsTheCylinderToTwoPercent) {
  const JunctionTarget target({{{1, 0, 0}, 1.0}, {{-1, 0, 0}, 1.0}, {{0, 0, 1}, 0.2}}, 0.15, 0.09);
  for (double x = -2; x <= 2; x += 0.1) {
    const Vec3 p = target.on_ray(Vec3(x, -1, 0).normalized(), 10);
    EXPECT_NEAR(-p.y(), 1, 0.02);
    EXPECT_NEAR(target.at(p).value, 0, 1e-8);
  }
}

}  // namespace
}  // namespace angiospline
