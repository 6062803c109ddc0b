#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "base/random.h"
#include "modeling/tree/clean_tree.h"
#include "modeling/tree/point_graph.h"
#include "modeling/tree/smooth_centerlines.h"

namespace angiospline {
namespace {

// Points and radii along a curve, joined in a line; ids from `first`.
template <typename Curve>
void add_line(PointGraph& graph, int count, int after, const Curve& curve) {
  for (int i = 0; i < count; ++i) {
    const Vec4 p = curve(static_cast<double>(i) / (count - 1));
    const int id = static_cast<int>(graph.points.size());
    graph.points.push_back({std::to_string(id), p.head<3>(), p(3)});
    if (i > 0 || after >= 0) graph.edges.emplace_back(i > 0 ? id - 1 : after, id);
  }
}

CenterlineTree tree_of(const PointGraph& graph) {
  const auto tree = tree_from_points(graph);
  EXPECT_TRUE(tree.has_value());
  return *tree;
}

Vec4 helix(double t) {
  const double a = 3 * std::numbers::pi * t;
  return {10 * std::cos(a), 10 * std::sin(a), 20 * t, 1.5 - 0.5 * t};
}

double distance_to_helix(const Vec3& p) {
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i <= 4000; ++i) least = std::min(least, (helix(i / 4000.0).head<3>() - p).norm());
  return least;
}

TEST(SmoothCenterlines, ExactPointsAreFollowed) {
  PointGraph graph;
  add_line(graph, 60, -1, helix);
  const auto smooth = smooth_centerlines(tree_of(graph));
  ASSERT_TRUE(smooth.has_value());
  ASSERT_EQ(smooth->paths.size(), 1U);
  const auto& path = smooth->paths[0];
  for (int i = 0; i <= 50; ++i) {
    const Vec4 p = path.at(path.knots().last() * i / 50);
    EXPECT_LT(distance_to_helix(p.head<3>()), 0.02);
    EXPECT_NEAR(path.at(path.knots().last() * i / 50, 1).head<3>().norm(), 1.0, 0.02);
  }
  EXPECT_LT(path.knots().control_point_count(), 40);
}

// Where two vessels touch, a tracer goes from one to the other through a neck of one voxel.
TEST(SmoothCenterlines, RadiiThatJumpAreFollowedWithoutSwinging) {
  const double radii[] = {2.23, 1.67, 1.16, 0.62, 0.31, 0.23, 0.27};
  PointGraph graph;
  add_line(graph, 36, -1, [&](double t) {
    const int i = static_cast<int>(std::lround(35 * t));
    const double z = i < 7 ? 0.7 * i : 4.2 + 0.3 * (i - 6);
    return Vec4(0.3 * std::sin(z), 0, z, i < 7 ? radii[i] : 1.9);
  });
  const auto smooth = smooth_centerlines(tree_of(graph));
  ASSERT_TRUE(smooth.has_value());
  const auto& path = smooth->paths[0];
  double least = 9;
  double before = path.at(0.0)(3);
  bool grows = false;
  for (int k = 0; k <= 400; ++k) {
    const double radius = path.at(path.knots().last() * k / 400)(3);
    EXPECT_LT(radius, 1.2 * 2.23) << k;
    least = std::min(least, radius);
    EXPECT_TRUE(grows || radius < 1.02 * before) << k << " on the way to the neck";
    grows = grows || radius < 0.4;
    before = radius;
  }
  EXPECT_GT(least, 0.1);
  EXPECT_LT(least, 0.35);
  EXPECT_NEAR(path.at(path.knots().last())(3), 1.9, 0.1);
}

TEST(SmoothCenterlines, NoiseIsTakenOutAndTheCurveKept) {
  Random random(7);
  PointGraph graph;
  add_line(graph, 150, -1, [&](double t) {
    Vec4 p = helix(t);
    for (int k = 0; k < 3; ++k) p(k) += 0.2 * random.gaussian();
    p(3) *= std::exp(0.1 * random.gaussian());
    return p;
  });
  const auto smooth = smooth_centerlines(tree_of(graph));
  ASSERT_TRUE(smooth.has_value());
  const auto& path = smooth->paths[0];
  double sum = 0;
  double radius_sum = 0;
  for (int i = 0; i <= 100; ++i) {
    const Vec4 p = path.at(path.knots().last() * i / 100);
    sum += std::pow(distance_to_helix(p.head<3>()), 2);
    radius_sum += std::abs(p(3) / helix(i / 100.0)(3) - 1);
  }
  EXPECT_LT(std::sqrt(sum / 101), 0.16) << "0.2 a coordinate is 0.28 across the curve";
  EXPECT_LT(radius_sum / 101, 0.03);
}

TEST(SmoothCenterlines, NoPointMovesFartherThanAllowed) {
  Random random(3);
  PointGraph graph;
  add_line(graph, 40, -1, [&](double t) {
    return Vec4(20 * t, random.uniform(-2, 2), random.uniform(-2, 2), 1.0);
  });
  for (const double most : {0.5, 0.1}) {
    SmoothingOptions options;
    options.largest_move = most;
    const auto smooth = smooth_centerlines(tree_of(graph), options);
    ASSERT_TRUE(smooth.has_value());
    EXPECT_LE(smooth->largest_move_mm, most * 1.0001);
    EXPECT_GT(smooth->largest_move_mm, 0.0);
    EXPECT_FALSE(smooth->warnings.empty()) << "such a zigzag cannot be smooth within half a radius";
  }
}

TEST(SmoothCenterlines, BranchesOfANodeMeetInIt) {
  Random random(5);
  PointGraph graph;
  const auto noisy = [&](Vec3 from, Vec3 to, double r) {
    return [&random, from, to, r](double t) {
      const Vec3 p = from + t * (to - from);
      return Vec4(p.x() + 0.1 * random.gaussian(), p.y() + 0.1 * random.gaussian(),
                  p.z() + 0.1 * random.gaussian(), r);
    };
  };
  add_line(graph, 20, -1, noisy({0, 0, 0}, {0, 0, 20}, 2));
  add_line(graph, 20, 19, noisy({1, 0, 21}, {15, 0, 40}, 1.5));
  add_line(graph, 20, 19, noisy({-1, 0, 21}, {-15, 0, 40}, 1.2));
  graph.roots = {0};
  const auto smooth = smooth_centerlines(tree_of(graph));
  ASSERT_TRUE(smooth.has_value());
  ASSERT_EQ(smooth->paths.size(), 3U);
  for (std::size_t b = 0; b < 3; ++b) {
    const CenterlineBranch& branch = smooth->tree.branches[b];
    const auto& path = smooth->paths[b];
    const auto node = [&](int n) { return smooth->tree.nodes[std::size_t(n)].position_mm; };
    EXPECT_LT((path.at(0).head<3>() - node(branch.from)).norm(), 1e-9);
    EXPECT_LT((path.at(path.knots().last()).head<3>() - node(branch.to)).norm(), 1e-9);
    EXPECT_EQ(branch.points_mm.col(0), node(branch.from));
  }
  EXPECT_EQ(smooth->tree.branches[0].name, "0_19");
}

TEST(SmoothCenterlines, TheResultDoesNotDependOnTheScale) {
  for (const double scale : {1e-3, 1e3}) {
    const auto tree = [](double s) {
      Random random(11);
      PointGraph graph;
      add_line(graph, 50, -1, [&](double t) {
        Vec4 p = helix(t);
        p(0) += 0.1 * random.gaussian();
        return Vec4(s * p);
      });
      return tree_of(graph);
    };
    const auto one = smooth_centerlines(tree(1.0));
    const auto other = smooth_centerlines(tree(scale));
    ASSERT_TRUE(one && other);
    const auto& a = one->paths[0];
    const auto& b = other->paths[0];
    ASSERT_EQ(a.knots().control_point_count(), b.knots().control_point_count());
    const double difference =
        (a.control_points() - b.control_points() / scale).cwiseAbs().maxCoeff();
    EXPECT_LT(difference, 1e-6);
  }
}

TEST(SmoothCenterlines, NothingWithALengthIsAnError) {
  CenterlineTree tree;
  tree.source = "t.swc";
  EXPECT_EQ(smooth_centerlines(tree).error().message(),
            "t.swc: no branch has a positive length (two points at different positions must be "
            "connected)");
}

TEST(CleanTree, SpursInsideTheLumenGoByNameAndTheirNodeIsJoined) {
  PointGraph graph;
  const auto straight = [](double from, double to) {
    return [=](double t) { return Vec4(0, 0, from + t * (to - from), 2.0); };
  };
  add_line(graph, 10, -1, straight(0, 9));
  add_line(graph, 10, 9, straight(10, 19));
  add_line(graph, 3, 9, [](double t) { return Vec4(0.5 + t, 0, 9, 0.5); });
  graph.roots = {0};
  const CleanedTree cleaned = clean_tree(tree_of(graph));
  ASSERT_EQ(cleaned.tree.branches.size(), 1U);
  EXPECT_EQ(cleaned.tree.branches[0].name, "0_19");
  EXPECT_EQ(cleaned.tree.branches[0].points_mm.cols(), 20);
  ASSERT_EQ(cleaned.warnings.size(), 1U);
  EXPECT_NE(cleaned.warnings[0].text.find("branch 9_22 ends inside the lumen"), std::string::npos);
}

TEST(CleanTree, ATwigThatLeavesTheLumenStays) {
  PointGraph graph;
  const auto straight = [](double from, double to) {
    return [=](double t) { return Vec4(0, 0, from + t * (to - from), 2.0); };
  };
  add_line(graph, 10, -1, straight(0, 9));
  add_line(graph, 10, 9, straight(10, 19));
  add_line(graph, 3, 9, [](double t) { return Vec4(1 + 2 * t, 0, 9, 0.5); });
  const CleanedTree cleaned = clean_tree(tree_of(graph));
  EXPECT_EQ(cleaned.tree.branches.size(), 3U);
  EXPECT_TRUE(cleaned.warnings.empty());
}

TEST(CleanTree, PointsTracedOutOfOrderAreExchangedAndHairpinsAreNot) {
  const auto of_points = [](std::vector<Vec3> points) {
    PointGraph graph;
    for (const Vec3& p : points) {
      const int id = static_cast<int>(graph.points.size());
      graph.points.push_back({std::to_string(id), p, 1.0});
      if (id > 0) graph.edges.emplace_back(id - 1, id);
    }
    return clean_tree(tree_of(graph));
  };
  const CleanedTree zigzag =
      of_points({{0, 0, 0}, {0, 0, 3}, {0.3, 0, 6}, {0, 0.6, 4.5}, {0, 0, 8}, {0, 0, 11}});
  EXPECT_EQ(zigzag.tree.branches[0].points_mm(2, 2), 4.5);
  EXPECT_EQ(zigzag.tree.branches[0].points_mm(2, 3), 6.0);
  ASSERT_EQ(zigzag.warnings.size(), 1U);
  EXPECT_NE(zigzag.warnings[0].text.find("branch 0_5: 2 points"), std::string::npos);
  const CleanedTree hairpin =
      of_points({{0, 0, 0}, {0, 0, 3}, {0, 0, 6}, {1.2, 0, 6.2}, {1.5, 0, 3}, {1.5, 0, 0}});
  EXPECT_TRUE(hairpin.warnings.empty());
  const CleanedTree spike = of_points({{0, 0, 0}, {0, 0, 6}, {1, 0, 3}, {1, 0, -2}});
  EXPECT_TRUE(spike.warnings.empty());
}

TEST(CleanTree, ARingKeepsOneNode) {
  PointGraph graph;
  add_line(graph, 24, -1, [](double t) {
    const double a = 2 * std::numbers::pi * t * 23 / 24;
    return Vec4(10 * std::cos(a), 10 * std::sin(a), 0, 1);
  });
  graph.edges.emplace_back(23, 0);
  const CleanedTree cleaned = clean_tree(tree_of(graph));
  ASSERT_EQ(cleaned.tree.branches.size(), 1U);
  EXPECT_EQ(cleaned.tree.branches[0].from, cleaned.tree.branches[0].to);
  EXPECT_EQ(cycle_count(cleaned.tree), 1);
  const auto smooth = smooth_centerlines(cleaned.tree);
  ASSERT_TRUE(smooth.has_value());
}

// ---- rounding

CenterlineTree scaled(CenterlineTree tree, double by) {
  for (CenterlineNode& node : tree.nodes) node.position_mm *= by;
  for (CenterlineBranch& branch : tree.branches) {
    branch.points_mm *= by;
    branch.radii_mm *= by;
  }
  return tree;
}

TEST(Rounded, GivesTheSameNumbersWhateverUnitTheyCameIn) {
  PointGraph graph;
  add_line(graph, 200, -1, helix);
  const CenterlineTree given = tree_of(graph);
  const CenterlineTree once = rounded(given);
  EXPECT_NE(once.branches[0].points_mm, given.branches[0].points_mm);
  EXPECT_LT((once.branches[0].points_mm - given.branches[0].points_mm).cwiseAbs().maxCoeff(),
            20 * 0x1p-30);
  EXPECT_LT(((once.branches[0].radii_mm - given.branches[0].radii_mm).array() /
             given.branches[0].radii_mm.array())
                .abs()
                .maxCoeff(),
            0x1p-30);
  for (const double unit : {1e-3, 0.1, 1e3, 1e6, 25.4}) {
    const CenterlineTree back = scaled(scaled(given, 1 / unit), unit);
    EXPECT_NE(back.branches[0].points_mm, given.branches[0].points_mm) << unit;
    const CenterlineTree same = rounded(back);
    EXPECT_EQ(same.branches[0].points_mm, once.branches[0].points_mm) << unit;
    EXPECT_EQ(same.branches[0].radii_mm, once.branches[0].radii_mm) << unit;
    EXPECT_EQ(same.nodes[0].position_mm, once.nodes[0].position_mm) << unit;
  }
  EXPECT_EQ(rounded(once).branches[0].points_mm, once.branches[0].points_mm);
  EXPECT_EQ(rounded(scaled(given, 0x1p-20)).branches[0].points_mm,
            0x1p-20 * once.branches[0].points_mm);
}

}  // namespace
}  // namespace angiospline
