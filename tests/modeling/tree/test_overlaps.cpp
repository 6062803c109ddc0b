#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "base/random.h"
#include "modeling/tree/keep_apart.h"
#include "modeling/tree/merge_lines.h"
#include "modeling/tree/overlaps.h"
#include "modeling/tree/point_graph.h"

namespace angiospline {
namespace {

CenterlineLine line(const std::string& name, const Vec3& from, const Vec3& to, double radius,
                    int count = 30) {
  CenterlineLine l{name, Points3(3, count), Eigen::VectorXd::Constant(count, radius)};
  for (int i = 0; i < count; ++i) l.points_mm.col(i) = from + (to - from) * i / (count - 1);
  return l;
}

SmoothedTree smooth_tree(const std::vector<CenterlineLine>& lines, bool attach = true) {
  MergeOptions options;
  options.attach_ends = attach;
  const auto tree = tree_from_points(merge_lines(lines, options).graph);
  EXPECT_TRUE(tree.has_value());
  const auto smooth = smooth_centerlines(*tree);
  EXPECT_TRUE(smooth.has_value());
  return *smooth;
}

TEST(Overlaps, TwoStraightVesselsOverlapByTheirRadiiLessTheirDistance) {
  const SmoothedTree tree = smooth_tree(
      {line("a", {0, 0, 0}, {30, 0, 0}, 1.0), line("b", {15, -15, 1.6}, {15, 15, 1.6}, 0.8)});
  const auto found = find_overlaps(tree);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].depth_mm, 0.2, 1e-6);
  EXPECT_LT((found[0].at_mm - Vec3(15, 0, 0.8)).norm(), 0.3);
  EXPECT_EQ(overlap_text(tree, found[0]).find("branches a and b overlap by 0.2 mm near ("), 0U);
}

TEST(Overlaps, VesselsApartAreNotReportedUnlessTheClearanceAsksForThem) {
  const SmoothedTree tree = smooth_tree(
      {line("a", {0, 0, 0}, {30, 0, 0}, 1.0), line("b", {15, -15, 2.1}, {15, 15, 2.1}, 1.0)});
  EXPECT_TRUE(find_overlaps(tree).empty());
  OverlapOptions options;
  options.clearance = 0.2;
  ASSERT_EQ(find_overlaps(tree, options).size(), 1U);
}

TEST(Overlaps, BranchesOfAJunctionOverlapThereByRight) {
  const SmoothedTree tree = smooth_tree(
      {line("a", {0, 0, 0}, {60, 0, 0}, 1.0, 61), line("b", {30, 0, 0}, {55, 14, 0}, 0.8)});
  ASSERT_EQ(tree.paths.size(), 3U);
  EXPECT_TRUE(find_overlaps(tree).empty());
}

TEST(Overlaps, ABranchThatReturnsIntoItsParentIsReported) {
  CenterlineLine back{"b", Points3(3, 60), Eigen::VectorXd::Constant(60, 0.8)};
  for (int i = 0; i < 60; ++i) {  // leaves upwards, comes back to touch the parent farther on
    const double t = i / 59.0;
    back.points_mm.col(i) =
        Vec3(20 + 30 * t, 0, 0.2 + 12 * std::sin(std::numbers::pi * t) + 1.4 * t);
  }
  const SmoothedTree tree = smooth_tree({line("a", {0, 0, 0}, {60, 0, 0}, 1.0, 61), back}, false);
  const auto found = find_overlaps(tree);
  ASSERT_FALSE(found.empty());
  for (const Overlap& o : found) EXPECT_NE(o.first, o.second);
}

// A trunk, a straight daughter, and one that leaves with it, turns after `way` and comes back
// across it, 0.9 beside its centerline, where the two may still overlap for their common junction.
SmoothedTree returning_tree(double way) {
  const auto branch = [](const std::string& name, int from, int to, double radius, int count) {
    return CenterlineBranch{name, from, to, Points3(3, count),
                            Eigen::VectorXd::Constant(count, radius)};
  };
  CenterlineTree tree;
  tree.nodes = {
      {"in", {-20, 0, 0}}, {"fork", {0, 0, 0}}, {"out", {30, 0, 0}}, {"back", {2.2, -12, 0.9}}};
  tree.inlets = {0};
  tree.branches = {branch("trunk", 0, 1, 1.0, 21), branch("straight", 1, 2, 0.8, 31),
                   branch("returns", 1, 3, 0.7, 121)};
  for (int i = 0; i <= 20; ++i) tree.branches[0].points_mm.col(i) = Vec3(i - 20, 0, 0);
  for (int i = 0; i <= 30; ++i) tree.branches[1].points_mm.col(i) = Vec3(i, 0, 0);
  // Out to (-1.6, way), a half circle, and straight back.
  const double turn = std::numbers::pi * 1.9;
  for (int i = 0; i <= 120; ++i) {
    const double s = (2 * way + 12 + turn) * i / 120.0;
    const double angle = std::clamp((s - way) / 1.9, 0.0, std::numbers::pi);
    const double y = s < way          ? s
                     : s < way + turn ? way + 1.9 * std::sin(angle)
                                      : 2 * way + turn - s;
    const double x = s < way ? -1.6 * s / way : 0.3 - 1.9 * std::cos(angle);
    const double z = 0.9 * std::clamp((s - way) / turn, 0.0, 1.0);
    tree.branches[2].points_mm.col(i) = Vec3(x, y, z);
  }
  const auto smooth = smooth_centerlines(tree);
  EXPECT_TRUE(smooth.has_value());
  return *smooth;
}

TEST(Overlaps, ABranchThatReturnsIntoItsSiblingBesideTheirJunctionIsReportedAndParted) {
  const SmoothedTree tree = returning_tree(7.0);
  const auto found = find_overlaps(tree);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(overlap_text(tree, found[0]).find("branches straight and returns overlap by "), 0U);
  EXPECT_LT((found[0].at_mm - Vec3(2.2, 0, 0.45)).norm(), 0.4);
  EXPECT_NEAR(found[0].depth_mm, 0.6, 0.1);
  for (const PathContact& c : find_path_contacts(tree)) {
    EXPECT_GT(c.second_along, 10.0) << "what overlaps at the fork is the junction's";
  }
  EXPECT_TRUE(find_overlaps(keep_apart(tree), {0.1}).empty());
}

// Two vessels that touch through a neck of one voxel: right behind it the thick part runs along the
// other's wall.
TEST(Overlaps, WhatLiesBehindANeckBesideItsJunctionIsReported) {
  const auto with_distance = [](double away) {
    CenterlineTree tree;
    tree.nodes = {
        {"in", {-20, 0, 0}}, {"neck", {0, 0, 0}}, {"out", {20, 0, 0}}, {"end", {24, 0, 0}}};
    tree.inlets = {0};
    const auto branch = [&](const std::string& name, int from, int to, int count, const auto& at) {
      CenterlineBranch b{name, from, to, Points3(3, count), Eigen::VectorXd(count)};
      for (int i = 0; i < count; ++i) {
        const Vec4 p = at(static_cast<double>(i) / (count - 1));
        b.points_mm.col(i) = p.head<3>();
        b.radii_mm(i) = p(3);
      }
      tree.branches.push_back(std::move(b));
    };
    branch("trunk", 0, 1, 21, [](double t) { return Vec4(-20 + 20 * t, 0, 0, 2.5); });
    branch("on", 1, 2, 21, [](double t) { return Vec4(20 * t, 0, 0, 2.5); });
    // Straight down, then along and away.
    branch("neck", 1, 3, 81, [=](double t) {
      const double s = 28 * t;
      const double radius = s < 1 ? 1.0 : s < away ? 0.3 : std::min(2.0, 0.3 + 2 * (s - away));
      const double x = std::max(0.0, s - away);
      return Vec4(x, 0, -std::min(s, away) - 0.12 * std::max(0.0, x - 4), radius);
    });
    tree.nodes[3].position_mm = tree.branches[2].points_mm.rightCols<1>();
    return smooth_centerlines(tree).value();
  };
  const auto found = find_overlaps(with_distance(4.2));
  ASSERT_FALSE(found.empty());
  EXPECT_LT(found.back().at_mm.z(), 0);
  EXPECT_NEAR(found.back().depth_mm, 0.3, 0.2);
  EXPECT_TRUE(find_overlaps(with_distance(5.2)).empty());
}

TEST(Overlaps, ABranchThatCrossesItselfIsReported) {
  CenterlineLine eight{"eight", Points3(3, 120), Eigen::VectorXd::Constant(120, 1.0)};
  for (int i = 0; i < 120; ++i) {
    const double t = 2 * std::numbers::pi * (0.9 * i / 119.0 - 0.1);
    eight.points_mm.col(i) = Vec3(20 * std::sin(t), 10 * std::sin(2 * t), 0.01 * i);
  }
  const auto found = find_overlaps(smooth_tree({eight}, false));
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].first, found[0].second);
}

TEST(Overlaps, AgreeWithBruteForceOnRandomSticks) {
  Random random(17);
  std::vector<CenterlineLine> sticks;
  for (int k = 0; k < 60; ++k) {
    const Vec3 p(random.uniform(0, 60), random.uniform(0, 60), random.uniform(0, 60));
    const Vec3 d(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
    const double r = std::exp(random.uniform(-2.0, 1.2));
    sticks.push_back(
        line(std::string("s").append(std::to_string(k)), p, p + 20 * d.normalized(), r, 12));
  }
  const SmoothedTree tree = smooth_tree(sticks, false);
  ASSERT_EQ(tree.paths.size(), sticks.size());
  const auto found = find_overlaps(tree);
  std::size_t expected = 0;
  constexpr int kSamples = 200;
  std::vector<Eigen::Matrix4Xd> samples;
  for (const auto& path : tree.paths) {
    samples.emplace_back(4, kSamples + 1);
    for (int i = 0; i <= kSamples; ++i) {
      samples.back().col(i) = path.at(path.knots().last() * i / kSamples);
    }
  }
  for (std::size_t a = 0; a < tree.paths.size(); ++a) {
    for (std::size_t b = a + 1; b < tree.paths.size(); ++b) {
      const double sum = samples[a](3, 0) + samples[b](3, 0);
      double squared = std::numeric_limits<double>::infinity();
      for (int i = 0; i <= kSamples; ++i) {
        const Vec3 p = samples[a].col(i).head<3>();
        squared = std::min(
            squared, (samples[b].topRows<3>().colwise() - p).colwise().squaredNorm().minCoeff());
      }
      const double least = std::sqrt(squared) - sum;
      const bool is_found = std::any_of(found.begin(), found.end(), [&](const Overlap& o) {
        return o.first == static_cast<int>(a) && o.second == static_cast<int>(b);
      });
      if (std::abs(least) < 0.02 * sum) continue;  // too close to call by samples
      EXPECT_EQ(is_found, least < 0) << a << " " << b << " " << least;
      expected += least < 0;
    }
  }
  EXPECT_GT(expected, 5U);
}

TEST(MergeLines, LinesThatOverlapBecomeABranchingGraph) {
  const Vec3 split(0, 0, 20);
  const auto path = [&](const Vec3& end, double noise, std::uint64_t seed) {
    Random random(seed);
    CenterlineLine l{"l", Points3(3, 80), Eigen::VectorXd::Constant(80, 2.0)};
    for (int i = 0; i < 80; ++i) {
      const Vec3 p = i < 40 ? Vec3(split * i / 40) : Vec3(split + (end - split) * (i - 40) / 39);
      l.points_mm.col(i) =
          p + noise * Vec3(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
    }
    return l;
  };
  const MergedLines merged = merge_lines(
      {path({15, 0, 40}, 0.1, 1), path({-15, 0, 40}, 0.1, 2), path({0, 15, 40}, 0.1, 3)});
  EXPECT_EQ(merged.overlapping, 2);
  const auto tree = tree_from_points(merged.graph);
  ASSERT_TRUE(tree.has_value());
  EXPECT_EQ(cycle_count(*tree), 0);
  EXPECT_EQ(component_count(*tree), 1);
  EXPECT_GE(tree->branches.size(), 4U);
  EXPECT_LE(tree->branches.size(), 5U) << "two junctions or one of four";
}

TEST(MergeLines, ALineThatLeavesAndReturnsClosesALoop) {
  CenterlineLine detour{"d", Points3(3, 61), Eigen::VectorXd::Constant(61, 1.0)};
  for (int i = 0; i <= 60; ++i) {
    const double x = i < 10 || i > 50 ? 0.0 : 8 * std::sin(std::numbers::pi * (i - 10) / 40.0);
    detour.points_mm.col(i) = Vec3(i, x, 0);
  }
  const MergedLines merged = merge_lines({line("a", {0, 0, 0}, {60, 0, 0}, 1.0, 61), detour});
  const auto tree = tree_from_points(merged.graph);
  ASSERT_TRUE(tree.has_value());
  EXPECT_EQ(cycle_count(*tree), 1);
  EXPECT_EQ(tree->branches.size(), 4U);
}

TEST(MergeLines, ALineInsideAnotherIsDroppedAndAnEndInALumenIsJoined) {
  const CenterlineLine a = line("a", {0, 0, 0}, {60, 0, 0}, 3.0, 61);
  const MergedLines merged = merge_lines({a, line("inside", {10, 0.1, 0}, {30, 0.1, 0}, 3.0),
                                          line("side", {30, 2.0, 0}, {40, 30, 0}, 1.0)});
  EXPECT_EQ(merged.dropped, 1);
  EXPECT_EQ(merged.attached, 1);
  const auto tree = tree_from_points(merged.graph);
  ASSERT_TRUE(tree.has_value());
  EXPECT_EQ(tree->branches.size(), 3U);
}

}  // namespace
}  // namespace angiospline
