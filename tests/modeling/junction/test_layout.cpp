// Where a junction's openings, nodes and unknowns lie before anything is solved.
#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "base/random.h"
#include "modeling/junction/unknowns.h"
#include "modeling/layout/rules.h"
#include "modeling/layout/start.h"
#include "tests/modeling/junction/sample_junction.h"

namespace angiospline {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

std::vector<double> sectors_of(const std::vector<double>& seams) {
  std::vector<double> sectors;
  for (std::size_t k = 0; k < seams.size(); ++k) {
    sectors.push_back(k + 1 < seams.size() ? seams[k + 1] - seams[k] : seams[0] + kTurn - seams[k]);
  }
  return sectors;
}

TEST(BoundedSeams, KeepSectorsBetweenHalfAndTwiceTheirShare) {
  Random random(7);
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<double> wanted(static_cast<std::size_t>(3 + trial % 5));
    for (double& w : wanted) w = random.uniform(0, kTurn);
    std::sort(wanted.begin(), wanted.end());
    const double share = kTurn / static_cast<double>(wanted.size());
    const std::vector<double> sectors = sectors_of(bounded_seams(wanted));
    double sum = 0;
    for (const double s : sectors) {
      EXPECT_GT(s, layout_rules::kLeastSector * share - 1e-6);
      EXPECT_LT(s, std::min(layout_rules::kMostSector * share, std::numbers::pi) + 1e-6);
      sum += s;
    }
    EXPECT_NEAR(sum, kTurn, 1e-12);
  }
}

TEST(BoundedSeams, AreTheWantedOnesWhereTheseAreEvenEnough) {
  const std::vector<double> wanted{0.3, 0.3 + 1.8, 0.3 + 4.0};
  const std::vector<double> seams = bounded_seams(wanted);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(wrapped_angle(seams[k] - wanted[k]), 0, 1e-12);
}

TEST(BoundedSeams, OfTwoAreHalves) {
  const std::vector<double> seams = bounded_seams({1.0, 1.7});
  EXPECT_NEAR(seams[1] - seams[0], std::numbers::pi, 1e-12);
  // As near to both as they can be.
  EXPECT_NEAR(wrapped_angle(seams[0] - 1.0), -wrapped_angle(seams[1] - 1.7), 1e-12);
}

TEST(RelaxedLayout, LiesOnItsTargetWithoutAFold) {
  for (const JunctionSpec& spec : {y_spec(), four_spec()}) {
    const SampleJunction j = sample_junction(spec);
    const int last = j.layout.grid.size() - 1;
    for (int p = 0; p < static_cast<int>(j.topology.patches.size()); ++p) {
      const auto node = [&](int a, int b) -> Vec3 {
        return j.layout.nodes.col(j.layout.grid.at(p, a, b));
      };
      for (int a = 1; a <= last; ++a) {
        for (int b = 0; b <= last; ++b) {
          EXPECT_LT(std::abs(j.target.foot(node(a, b)).distance), 0.01);
        }
      }
      for (int a = 0; a < last; ++a) {
        for (int b = 0; b < last; ++b) {
          const Vec3 n = j.layout.normals.col(j.layout.grid.at(p, a, b));
          EXPECT_GT(n.dot((node(a + 1, b) - node(a, b)).cross(node(a, b + 1) - node(a, b))), 0);
        }
      }
    }
  }
}

TEST(RelaxedLayout, HasItsOpeningsOnTheirCircles) {
  const SampleJunction j = sample_junction(four_spec());
  ASSERT_EQ(j.layout.openings.size(), 4U);
  for (std::size_t b = 0; b < 4; ++b) {
    const OpeningFrame& frame = j.layout.openings[b];
    EXPECT_LT((frame.center - j.plan.opening(b)).norm(), 1e-12);
    EXPECT_EQ(frame.seams_rad.size(), j.topology.sectors[b].size());
    for (const int p : j.topology.sectors[b]) {
      for (int k = 0; k < j.layout.grid.size(); ++k) {
        const Vec3 arm = Vec3(j.layout.nodes.col(j.layout.grid.at(p, 0, k))) - frame.center;
        EXPECT_NEAR(arm.norm(), frame.radius, 1e-12);
        EXPECT_NEAR(arm.dot(frame.axis), 0, 1e-12);
      }
    }
  }
}

TEST(StartNet, LetsRimsBeFixedSecondRowsSlideAndTheRestMove) {
  const SampleJunction j = sample_junction(y_spec());
  JunctionNet net = start_net(j.topology, j.layout);
  int unknowns = 0;
  for (const ControlSlot& slot : net.slots) {
    EXPECT_EQ(slot.first, unknowns);
    unknowns += slot.count;
  }
  EXPECT_EQ(unknowns, net.unknowns);
  const Points3 before = net.points;
  Random random(3);
  Eigen::VectorXd move(net.unknowns);
  for (double& m : move) m = random.gaussian();
  net.apply(move);
  for (std::size_t b = 0; b < j.topology.sectors.size(); ++b) {
    const Vec3& axis = j.layout.openings[b].axis;
    for (const int p : j.topology.sectors[b]) {
      for (int k = 0; k < 6; ++k) {
        const int rim = net.grid.at(p, 0, k), second = net.grid.at(p, 1, k);
        EXPECT_EQ(net.points.col(rim), before.col(rim));
        EXPECT_LT((net.points.col(second) - net.points.col(rim)).cross(axis).norm(), 1e-12);
        EXPECT_GT((before.col(rim) - before.col(second)).dot(axis),
                  0.09 * j.layout.openings[b].radius);
      }
    }
  }
  EXPECT_GT((net.points - before).norm(), 1);
}

TEST(PlanOpenings, LeavesWhereTheOthersCountForLittle) {
  for (const JunctionSpec& spec : {y_spec(), four_spec()}) {
    const OpeningPlan plan = plan_openings(spec, {}).value();
    const JunctionTarget target(plan.branches, plan.blend, plan.rounding);
    for (std::size_t b = 0; b < spec.branches.size(); ++b) {
      const TargetBranch& branch = plan.branches[b];
      const Vec3 x = branch.direction.unitOrthogonal(), y = branch.direction.cross(x);
      const auto largest = [&](double distance) {
        double most = 0;
        for (int k = 0; k < 24; ++k) {
          const double a = kTurn * k / 24;
          const Vec3 p =
              distance * branch.direction + branch.radius * (std::cos(a) * x + std::sin(a) * y);
          most = std::max(most, target.others_share(static_cast<int>(b), p));
        }
        return most;
      };
      EXPECT_LE(largest(plan.distances[b]), 0.05);
      // Without the margin it is as near as it may be, or a radius away.
      const double end = plan.distances[b] - 1.0 * branch.radius;
      EXPECT_TRUE(end <= branch.radius * 1.001 || largest(end - 0.01) > 0.05);
    }
  }
}

TEST(PlanOpenings, DoesNotDependOnTheUnit) {
  JunctionSpec spec = four_spec();
  const OpeningPlan plan = plan_openings(spec, {}).value();
  for (JunctionBranch& b : spec.branches) b.radius_mm *= 7;
  const OpeningPlan large = plan_openings(spec, {}).value();
  EXPECT_NEAR(large.unit_mm, 7 * plan.unit_mm, 1e-12);
  for (std::size_t b = 0; b < plan.distances.size(); ++b) {
    EXPECT_NEAR(large.distances[b], plan.distances[b], 1e-9);
  }
}

TEST(PlanOpenings, GivesWayToAShortBranchAndNamesOneThatIsTooShort) {
  JunctionSpec spec = y_spec();
  const OpeningPlan plan = plan_openings(spec, {}).value();
  spec.branches[1].longest_mm = (plan.distances[1] - 0.3 * 0.8) * plan.unit_mm;
  const OpeningPlan near = plan_openings(spec, {}).value();
  EXPECT_NEAR(near.distances[1] * near.unit_mm, spec.branches[1].longest_mm, 1e-12);
  spec.branches[1].longest_mm = 0.2;
  const auto none = plan_openings(spec, {});
  ASSERT_FALSE(none);
  EXPECT_NE(none.error().message().find("branch is too short"), std::string::npos);
  EXPECT_NE(none.error().message().find(spec.branches[1].name), std::string::npos);
}

}  // namespace
}  // namespace angiospline
