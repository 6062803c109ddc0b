// The plan as a value, and each of the steps that make it.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "base/index.h"
#include "base/random.h"
#include "modeling/body/path.h"
#include "modeling/build/plan.h"
#include "modeling/build/plan_bends.h"
#include "modeling/build/plan_edits.h"
#include "modeling/build/plan_measures.h"
#include "modeling/build/plan_relief.h"
#include "modeling/build/plan_room.h"
#include "modeling/build/plan_settling.h"
#include "modeling/build/rules.h"

namespace angiospline {
namespace {

// A tree whose paths are its polylines, so that nothing but the plan is looked at.
struct Sticks {
  SmoothedTree tree;

  int node(const Vec3& p, const std::string& name) {
    tree.tree.nodes.push_back({name, p});
    return static_cast<int>(tree.tree.nodes.size()) - 1;
  }
  void line(int from, int to, double radius) {
    const Vec3 a = tree.tree.nodes[index(from)].position_mm;
    const Vec3 b = tree.tree.nodes[index(to)].position_mm;
    curve(from, to, radius, {a, b});
  }
  // Through these places, evenly in arc length as smoothed paths are.
  void curve(int from, int to, double radius, const std::vector<Vec3>& places) {
    const auto count = static_cast<Eigen::Index>(places.size());
    CenterlineBranch branch;
    branch.name = tree.tree.nodes[index(from)].name + "_" + tree.tree.nodes[index(to)].name;
    branch.from = from;
    branch.to = to;
    branch.points_mm.resize(3, count);
    for (Eigen::Index i = 0; i < count; ++i) branch.points_mm.col(i) = places[index(i)];
    branch.radii_mm = Eigen::VectorXd::Constant(count, radius);
    std::vector<double> knots{0.0, 0.0};
    for (Eigen::Index i = 1; i < count; ++i) {
      knots.push_back(knots.back() + (places[index(i)] - places[index(i - 1)]).norm());
    }
    knots.push_back(knots.back());
    Eigen::Matrix4Xd points(4, count);
    points << branch.points_mm, branch.radii_mm.transpose();
    tree.paths.emplace_back(KnotVector::make(1, knots).value(), points);
    tree.tree.branches.push_back(std::move(branch));
  }
};

// Three branches of 20 mm at 120 degrees in a plane, 1 mm thick.
Sticks star(double radius = 1.0) {
  Sticks sticks;
  const int middle = sticks.node({0, 0, 0}, "m");
  for (int k = 0; k < 3; ++k) {
    const double angle = 2 * std::numbers::pi * k / 3;
    const int tip =
        sticks.node({20 * std::cos(angle), 20 * std::sin(angle), 0}, std::string(1, "abc"[k]));
    sticks.line(middle, tip, radius);
  }
  return sticks;
}

// Two forks with `length` of trunk between them.
Sticks two_forks(double length) {
  Sticks sticks;
  const int low = sticks.node({0, 0, 0}, "low");
  const int high = sticks.node({0, 0, length}, "high");
  sticks.line(low, high, 1.0);
  for (const double side : {-1.0, 1.0}) {
    const std::string name = side < 0 ? "left" : "right";
    sticks.line(low, sticks.node({15 * side, 0, -15}, "low_" + name), 1.0);
    sticks.line(high, sticks.node({0, 15 * side, length + 15}, "high_" + name), 1.0);
  }
  return sticks;
}

int junction_count(const Plan& plan) {
  return static_cast<int>(std::count_if(plan.nodes.begin(), plan.nodes.end(),
                                        [](const PlannedNode& n) { return n.is_junction(); }));
}

TEST(PlannedBranch, FindsTheDistanceFromACentreFromEitherEnd) {
  const Plan plan = unsettled_plan(star().tree, {});
  const PlannedBranch& branch = plan.branches[0];
  EXPECT_NEAR(branch.length_mm(), 20, 1e-12);
  EXPECT_NEAR(branch.along_at_distance({0, false}, Vec3::Zero(), 7.3).value(), 7.3, 1e-12);
  // From the tip, whose own centre is 20 mm away.
  EXPECT_NEAR(branch.along_at_distance({0, true}, {20, 0, 0}, 4.5).value(), 4.5, 1e-12);
  EXPECT_FALSE(branch.along_at_distance({0, false}, Vec3::Zero(), 20.1).has_value());
  EXPECT_NEAR((branch.at_from({0, true}, 4.5).head<3>() - Vec3(15.5, 0, 0)).norm(), 0, 1e-12);
}

TEST(PlannedBranch, ThatPassesACentreCountsFromWhereItPasses) {
  const Plan plan = unsettled_plan(star().tree, {});
  const PlannedBranch& branch = plan.branches[0];  // along x, sampled every sixth of a millimetre
  const Vec3 beside(3, 1, 0);
  EXPECT_NEAR(branch.along_nearest({0, false}, beside), 3, 0.1);
  // The distance 2 is left at sqrt(3) beyond the nearest place, not where the path begins.
  EXPECT_NEAR(branch.along_at_distance({0, false}, beside, 2).value(), 3 + std::sqrt(3), 0.02);
  // One that it leaves from the beginning on is not passed.
  EXPECT_LE(branch.along_nearest({0, false}, {-1, 0, 0}), 0.0);
}

TEST(PlanEdits, ANodeOfTwoBranchesIsNoNodeWhicheverWayTheyRun) {
  for (const bool first_turned : {false, true}) {
    for (const bool second_turned : {false, true}) {
      Sticks sticks;
      const int a = sticks.node({0, 0, 0}, "a");
      const int m = sticks.node({0, 0, 10}, "m");
      const int b = sticks.node({0, 8, 10}, "b");
      first_turned ? sticks.line(m, a, 1.0) : sticks.line(a, m, 1.0);
      second_turned ? sticks.line(b, m, 1.0) : sticks.line(m, b, 1.0);
      Plan plan = unsettled_plan(sticks.tree, {});
      join_through(plan, m);

      const PlannedBranch& joined = plan.branches[0];
      EXPECT_FALSE(plan.nodes[index(m)].alive);
      EXPECT_FALSE(plan.branches[1].alive);
      EXPECT_NEAR(joined.length_mm(), 18, 1e-9);
      EXPECT_EQ(joined.from, a);
      EXPECT_EQ(joined.to, b);
      EXPECT_NEAR((joined.at(0).head<3>() - Vec3(0, 0, 0)).norm(), 0, 1e-12);
      EXPECT_NEAR((joined.at(10).head<3>() - Vec3(0, 0, 10)).norm(), 0, 1e-9);
      EXPECT_NEAR((joined.at(18).head<3>() - Vec3(0, 8, 10)).norm(), 0, 1e-9);
      EXPECT_EQ(plan.slot({0, false}), 0U);
      EXPECT_EQ(plan.slot({0, true}), 0U);
    }
  }
}

TEST(PlanEdits, MergingHoldsTheNewNodeNearTheThickerBranches) {
  for (const double thick : {1.0, 2.0}) {
    Sticks sticks = two_forks(9);
    // The two that end at "low" become thicker; sections count: 2 thick^2 against 2.
    for (const std::size_t b : {1U, 3U}) {
      Eigen::Matrix4Xd points = sticks.tree.paths[b].control_points();
      points.row(3).setConstant(thick);
      sticks.tree.paths[b] = BSplineCurve<4>(sticks.tree.paths[b].knots(), points);
    }
    Plan plan = unsettled_plan(sticks.tree, {});
    merge(plan, 0, 0.5, "is short");

    const PlannedNode& merged = plan.nodes[0];
    EXPECT_EQ(merged.name, "low+high");
    EXPECT_TRUE(merged.merged);
    EXPECT_NEAR(merged.center_mm.z(), 9 / (1 + thick * thick), 1e-9);
    ASSERT_EQ(merged.absorbed.size(), 1U);
    EXPECT_EQ(merged.absorbed[0].branch, 0);
    EXPECT_EQ(merged.absorbed[0].fits, 0.5);
    EXPECT_FALSE(plan.nodes[1].alive);
    ASSERT_EQ(merged.ends.size(), 4U);
    for (std::size_t k = 0; k < 4; ++k) {
      EXPECT_EQ(merged.ends[k].branch, static_cast<int>(k) + 1);
      EXPECT_EQ(plan.branches[k + 1].from, 0);
    }
    ASSERT_EQ(plan.warnings.size(), 1U);
    EXPECT_EQ(plan.warnings[0].text, "junctions low and high became one: low_high is short");
  }
}

TEST(PlanEdits, DroppingABranchOfAForkLeavesOneBranchThrough) {
  Plan plan = unsettled_plan(star().tree, {});
  drop(plan, 1, "it is not wanted");
  EXPECT_FALSE(plan.branches[1].alive);
  EXPECT_FALSE(plan.nodes[0].alive);
  EXPECT_FALSE(plan.nodes[2].alive);
  EXPECT_TRUE(plan.branches[0].alive);
  EXPECT_NEAR(plan.branches[0].length_mm(), 40, 1e-9);
  EXPECT_EQ(plan.warnings, (std::vector<Warning>{{WarningCode::kBranchLeftOut,
                                                  "branch m_b was left out: it is not wanted"}}));
}

TEST(PlanEdits, AFreeEndGrowsStraightOnByWhatIsMissing) {
  Plan plan = unsettled_plan(star().tree, {});
  extend(plan, 0, 2.5);
  EXPECT_NEAR(plan.branches[0].length_mm(), 22.5, 1e-9);
  EXPECT_NEAR((plan.branches[0].at(22.5).head<3>() - Vec3(22.5, 0, 0)).norm(), 0, 1e-9);
  EXPECT_NEAR((plan.branches[0].at(0).head<3>()).norm(), 0, 1e-12);
  ASSERT_EQ(plan.warnings.size(), 1U);
}

TEST(PlanMeasures, OpeningsOfASymmetricStarLieOnTheirBranchesAtOneDistance) {
  const Plan plan = unsettled_plan(star().tree, {});
  const PlannedNode node = measured(plan, plan.nodes[0]);
  ASSERT_FALSE(node.error);
  for (std::size_t k = 0; k < 3; ++k) {
    const double angle = 2 * std::numbers::pi * static_cast<double>(k) / 3;
    const Vec3 axis(std::cos(angle), std::sin(angle), 0);
    EXPECT_NEAR((node.spec.branches[k].direction - axis).norm(), 0, 1e-9);
    EXPECT_NEAR(node.spec.branches[k].radius_mm, 1, 1e-12);
    EXPECT_NEAR(node.wanted_mm[k], node.wanted_mm[0], 1e-9);
    EXPECT_LT(node.least_mm[k], node.wanted_mm[k]);
    EXPECT_GT(node.least_mm[k], 0.5);
    EXPECT_EQ(node.meets_mm[k], 0);
  }
  // What was measured is what make_junction's own distances are for these directions.
  const auto distances = opening_distances_mm(node.spec, plan.options);
  ASSERT_TRUE(distances);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(node.wanted_mm[k], (*distances)[k]);
}

TEST(PlanMeasures, KeepsToWhatTheNodeAsksFor) {
  const Plan plan = unsettled_plan(star().tree, {});
  const PlannedNode free = measured(plan, plan.nodes[0]);
  PlannedNode asked = free;
  asked.caps_mm[0] = (free.least_mm[0] + free.wanted_mm[0]) / 2;
  asked.farther_mm[1] = free.wanted_mm[1] + 3;
  asked = measured(plan, asked);
  EXPECT_NEAR(asked.wanted_mm[0], (free.least_mm[0] + free.wanted_mm[0]) / 2, 1e-9);
  EXPECT_GE(asked.follows_mm(1), free.wanted_mm[1] + 3);
}

TEST(PlanMeasures, TwoBranchesOnOnePathHaveNoOpenings) {
  Sticks sticks = star();
  sticks.line(0, sticks.node({20, 0, 0}, "twin"), 1.0);
  const Plan plan = unsettled_plan(sticks.tree, {});
  EXPECT_TRUE(measured(plan, plan.nodes[0]).error.has_value());
}

TEST(PlanRelief, StraightBranchesStrainNothingAndAHookDoes) {
  const Plan plain = unsettled_plan(star().tree, {});
  const PlannedNode node = measured(plain, plain.nodes[0]);
  EXPECT_NEAR(strain_of(plain, node), 0, 1e-6);
  EXPECT_EQ(relieved(plain, node).center_mm, node.center_mm);

  // The first branch turns by a right angle four millimetres out.
  Sticks sticks;
  const int m = sticks.node({0, 0, 0}, "m");
  sticks.curve(m, sticks.node({3, 0, 20}, "a"), 1.0, {{0, 0, 0}, {3, 0, 0}, {3, 0, 20}});
  sticks.line(m, sticks.node({-20, 3, 0}, "b"), 1.0);
  sticks.line(m, sticks.node({0, -20, 0}, "c"), 1.0);
  const Plan plan = unsettled_plan(sticks.tree, {});
  const PlannedNode bent = measured(plan, plan.nodes[0]);
  EXPECT_GT(strain_at(plan, bent, 0), 0.6);
  EXPECT_NEAR(strain_at(plan, bent, 1), 0, 1e-6);
  EXPECT_EQ(strain_of(plan, bent), strain_at(plan, bent, 0));

  // Whatever is chosen saves at least what is worth a change, or nothing is.
  const PlannedNode eased = relieved(plan, bent);
  EXPECT_TRUE(eased.relieved);
  EXPECT_LE(strain_of(plan, eased), strain_of(plan, bent) - ReliefRules::kWorthMoving);
}

TEST(PlanRelief, BranchesThatLeaveTogetherMayPartFromFartherOn) {
  Sticks sticks;
  const int m = sticks.node({0, 0, 0}, "m");
  // Side by side along z for 6 mm, then apart.
  for (const double side : {-1.0, 1.0}) {
    sticks.curve(m, sticks.node({20 * side, 0, 20}, side < 0 ? "a" : "b"), 1.0,
                 {{0, 0, 0}, {0.2 * side, 0, 6}, {20 * side, 0, 20}});
  }
  sticks.line(m, sticks.node({0, 0, -20}, "c"), 1.0);
  const Plan plan = unsettled_plan(sticks.tree, {});
  const PlannedNode node = measured(plan, plan.nodes[0]);
  const std::vector<Vec3> centres = other_centres(plan, node);
  ASSERT_GE(centres.size(), 5U);
  for (std::size_t k = 0; k < centres.size(); ++k) {
    EXPECT_NEAR(centres[k].x(), 0, 1e-9);
    EXPECT_NEAR(centres[k].z(), static_cast<double>(k + 1), 0.7);
  }
  const Plan other = unsettled_plan(star().tree, {});
  EXPECT_TRUE(other_centres(other, measured(other, other.nodes[0])).empty());
}

TEST(PlanRoom, IsTheLengthOfTheBranchAgainstItsOpeningsAndBody) {
  Plan plan = unsettled_plan(two_forks(12).tree, {});
  for (const std::size_t n : {0U, 1U}) plan.nodes[n] = measured(plan, plan.nodes[n]);
  const BranchRoom room = room_of(plan, 0);
  EXPECT_TRUE(room.known);
  EXPECT_NEAR(room.length, 12, 1e-9);
  EXPECT_NEAR(room.body, RoomRules::kLeastBody, 1e-9);
  const double both = plan.nodes[0].least_mm[0] + plan.nodes[1].least_mm[0];
  EXPECT_NEAR(room.least, both + room.body, 1e-6);
  EXPECT_TRUE(room.fits());

  // Shared out: both openings and the body together are no longer than the branch.
  tighten(plan);
  const double first = plan.nodes[0].spec.branches[0].longest_mm;
  const double second = plan.nodes[1].spec.branches[0].longest_mm;
  EXPECT_GE(first, plan.nodes[0].least_mm[0]);
  EXPECT_GE(second, plan.nodes[1].least_mm[0]);
  EXPECT_LE(first + second + room.body, 12 + 1e-6);
}

TEST(PlanRoom, ABranchIsTakenStraightOnlyWhereItsChordStaysInTheVessel) {
  for (const double sag : {0.5, 0.9}) {
    const Sticks sticks = two_forks(2);
    // The trunk in an arc of three points.
    Sticks bent;
    bent.tree.tree.nodes = sticks.tree.tree.nodes;
    bent.curve(0, 1, 1.0, {{0, 0, 0}, {sag, 0, 1}, {0, 0, 2}});
    for (std::size_t b = 1; b < sticks.tree.paths.size(); ++b) {
      bent.tree.paths.push_back(sticks.tree.paths[b]);
      bent.tree.tree.branches.push_back(sticks.tree.tree.branches[b]);
    }
    Plan plan = unsettled_plan(bent.tree, {});
    for (const std::size_t n : {0U, 1U}) plan.nodes[n] = measured(plan, plan.nodes[n]);
    const BranchRoom room = room_of(plan, 0);
    ASSERT_FALSE(room.fits());
    EXPECT_EQ(straighten(plan, 0, room, BendCheck::kSkip), sag < RoomRules::kDeepestSag);
    EXPECT_EQ(plan.branches[0].straight, sag < RoomRules::kDeepestSag);
  }
}

TEST(PlanSettling, JunctionsBecomeOneExactlyWhereTheLengthBetweenThemDoesNotDo) {
  const Plan far = make_plan(two_forks(12).tree, {});
  EXPECT_EQ(junction_count(far), 2);
  EXPECT_TRUE(far.warnings.empty());
  const Plan near = make_plan(two_forks(1).tree, {});
  EXPECT_EQ(junction_count(near), 1);
  ASSERT_EQ(near.warnings.size(), 1U);
  EXPECT_EQ(near.warnings[0].text.find("junctions low and high became one: low_high is 1 mm long"),
            0U);
  EXPECT_EQ(near.nodes[0].ends.size(), 4U);
}

// Trees of forks whose branches are between one and twelve radii long.
Sticks random_tree(Random& random) {
  Sticks sticks;
  struct Tip {
    int node;
    Vec3 direction;
  };
  std::vector<Tip> tips{{sticks.node({0, 0, 0}, "n0"), Vec3::UnitZ()}};
  for (std::size_t k = 0; k < 12 && k < tips.size(); ++k) {
    const Tip tip = tips[k];
    const Vec3 side = tip.direction.unitOrthogonal();
    for (const double sign : {-1.0, 1.0}) {
      const double angle = sign * random.uniform(0.4, 1.2);
      const Vec3 axis = Eigen::AngleAxisd(random.uniform(0, 6.28), tip.direction) * side;
      const Vec3 direction = Eigen::AngleAxisd(angle, axis) * tip.direction;
      const Vec3 from = sticks.tree.tree.nodes[index(tip.node)].position_mm;
      std::string name = std::to_string(sticks.tree.tree.nodes.size());
      name.insert(name.begin(), 'n');
      const int to = sticks.node(from + random.uniform(1, 12) * direction, name);
      sticks.line(tip.node, to, random.uniform(0.7, 1.0));
      tips.push_back({to, direction});
      if (k == 0) break;  // the root has one branch
    }
  }
  return sticks;
}

TEST(PlanSettling, EveryBranchOfASettledPlanHasRoomAndNoNodeJoinsTwo) {
  Random random(20261201);
  int merged = 0;
  int branches = 0;
  for (int trial = 0; trial < 12; ++trial) {
    const Plan plan = make_plan(random_tree(random).tree, {});
    for (int b = 0; b < static_cast<int>(plan.branches.size()); ++b) {
      if (!plan.branches[index(b)].alive) continue;
      ++branches;
      const BranchRoom room = room_of(plan, b);
      if (room.known) {
        EXPECT_GE(room.length, room.least * (1 - 1e-6)) << plan.branches[index(b)].name;
      }
      // Ends and nodes know each other.
      for (const bool at_end : {false, true}) {
        EXPECT_LT(plan.slot({b, at_end}), plan.node({b, at_end}).ends.size());
      }
    }
    for (const PlannedNode& node : plan.nodes) {
      if (!node.alive) continue;
      EXPECT_FALSE(node.ends.size() == 2 && node.ends[0].branch != node.ends[1].branch);
      merged += node.merged ? 1 : 0;
    }
    EXPECT_TRUE(std::all_of(plan.dirty.begin(), plan.dirty.end(), [](char d) { return d == 0; }));
  }
  EXPECT_GT(branches, 100);
  EXPECT_GT(merged, 3);
}

TEST(PlanBends, StraightTreesHaveNothingToBend) {
  Plan plan = make_plan(two_forks(12).tree, {});
  find_bends(plan);
  for (const auto& ways : plan.bends) EXPECT_TRUE(ways.empty());
  EXPECT_TRUE(bend(plan, std::vector<int>(plan.nodes.size(), 0)).empty());
}

TEST(PlanEdits, MergesWithTheNearestJunctionOnlyWithinReach) {
  Plan plan = make_plan(two_forks(12).tree, {});
  EXPECT_FALSE(merge_with_nearest(plan, 0, 6.0));
  EXPECT_TRUE(merge_with_nearest(plan, 0, 13.0));
  EXPECT_FALSE(plan.nodes[1].alive);
  EXPECT_FALSE(merge_along(plan, 0));
}

}  // namespace
}  // namespace angiospline
