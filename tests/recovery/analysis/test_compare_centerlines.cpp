#include <gtest/gtest.h>

#include "recovery/analysis/compare_centerlines.h"

namespace angiospline {
namespace {

// Straight branches, each between two nodes of its own.
struct Line {
  Vec3 a, b;
  double radius = 2;
};

CenterlineTree tree_of(const std::vector<Line>& lines) {
  CenterlineTree tree;
  for (const Line& line : lines) {
    const auto n = static_cast<int>(tree.nodes.size());
    tree.nodes.push_back({"a", line.a});
    tree.nodes.push_back({"b", line.b});
    CenterlineBranch branch;
    branch.from = n;
    branch.to = n + 1;
    branch.points_mm.resize(3, 2);
    branch.points_mm << line.a, line.b;
    branch.radii_mm = Eigen::Vector2d::Constant(line.radius);
    tree.branches.push_back(std::move(branch));
  }
  return tree;
}

TEST(CenterlineOverlap, IsOneForATreeAndItself) {
  const CenterlineTree tree = tree_of({{Vec3(0, 0, 0), Vec3(50, 0, 0)}});
  const CenterlineOverlap o = centerline_overlap(tree, tree);
  EXPECT_DOUBLE_EQ(o.overlap, 1);
  EXPECT_DOUBLE_EQ(o.found, 1);
  EXPECT_DOUBLE_EQ(o.correct, 1);
  EXPECT_NEAR(o.offset_mm, 0, 1e-12);
  EXPECT_DOUBLE_EQ(o.truth_length_mm, 50);
}

TEST(CenterlineOverlap, CountsLengthThatIsMissedAndLengthThatIsWrong) {
  // 30 of 40 mm found, of a result of 60 mm of which half is far away.
  const CenterlineTree truth = tree_of({{Vec3(0, 0, 0), Vec3(40, 0, 0), 0.8}});
  const CenterlineTree result =
      tree_of({{Vec3(0, 0.5, 0), Vec3(30, 0.5, 0)}, {Vec3(0, 90, 0), Vec3(30, 90, 0)}});
  const CenterlineOverlap o = centerline_overlap(truth, result);
  EXPECT_NEAR(o.found, 30.7 / 40, 0.01);  // and what lies within a radius of its end
  EXPECT_NEAR(o.correct, 0.5, 1e-12);
  EXPECT_NEAR(o.overlap, (30.7 + 30) / 100, 0.005);
  EXPECT_NEAR(o.offset_mm, 0.5, 0.02);
}

TEST(CenterlineOverlap, TakesTheRadiusOfTheTruthNotOfTheResult) {
  const Line line{Vec3(0, 0, 0), Vec3(20, 0, 0), 1.0};
  const CenterlineTree beside = tree_of({{Vec3(0, 1.5, 0), Vec3(20, 1.5, 0), 9.0}});
  EXPECT_EQ(centerline_overlap(tree_of({line}), beside).overlap, 0);
  EXPECT_EQ(centerline_overlap(beside, tree_of({line})).overlap, 1);
}

TEST(CenterlineOverlap, HasAStatedAnswerForEmptyTrees) {
  const CenterlineTree tree = tree_of({{Vec3(0, 0, 0), Vec3(5, 0, 0)}});
  EXPECT_EQ(centerline_overlap({}, {}).overlap, 1);
  EXPECT_EQ(centerline_overlap(tree, {}).overlap, 0);
  EXPECT_EQ(centerline_overlap(tree, {}).found, 0);
  EXPECT_EQ(centerline_overlap({}, tree).correct, 0);
}

}  // namespace
}  // namespace angiospline
