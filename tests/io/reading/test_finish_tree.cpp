#include <array>

#include <gtest/gtest.h>

#include "io/reading/finish_tree.h"
#include "io/reading/reader_options.h"

namespace angiospline {
namespace {

PointGraph line() {
  PointGraph graph;
  graph.points = {{"a", Vec3(1, 2, 3), 4}, {"b", Vec3(5, 6, 7), 8}};
  graph.edges = {{0, 1}};
  graph.roots = {0};
  return graph;
}

CenterlineTree finished(const FileFacts& facts, const CenterlineFileOptions& options) {
  const auto tree = finish_tree(line(), facts, "f", options);
  EXPECT_TRUE(tree.has_value());
  return tree.value_or(CenterlineTree{});
}

TEST(FinishTree, ScalesLengthsToMillimetres) {
  FileFacts facts;
  facts.state_unit(10, "cm");
  const CenterlineTree tree = finished(facts, {});
  EXPECT_EQ(tree.branches[0].points_mm.col(1), Vec3(50, 60, 70));
  EXPECT_EQ(tree.branches[0].radii_mm[1], 80);
  EXPECT_EQ(tree.assumptions[0], "unit: cm, as the file says");
}

TEST(FinishTree, TheCallersWordIsStrongerThanTheFiles) {
  FileFacts facts;
  facts.state_unit(10, "cm");
  facts.has_diameters = true;
  facts.frame = CoordinateFrame::kRas;
  CenterlineFileOptions options;
  options.unit_mm = 2.0;
  options.frame = CoordinateFrame::kLps;
  const CenterlineTree tree = finished(facts, options);
  EXPECT_EQ(tree.branches[0].points_mm.col(1), Vec3(10, 12, 14)) << "not turned";
  EXPECT_EQ(tree.branches[0].radii_mm[1], 8) << "half of a diameter of 16";
  EXPECT_EQ(tree.assumptions[0], "unit: 2 mm, as given");
  EXPECT_EQ(tree.assumptions[1], "radius column: diameters, as the file says");
  EXPECT_EQ(tree.assumptions[2], "frame: LPS, as given");
}

TEST(FinishTree, RasTurnsIntoLpsByTheSignsOfTwoAxes) {
  FileFacts facts;
  facts.frame = CoordinateFrame::kRas;
  EXPECT_EQ(finished(facts, {}).branches[0].points_mm.col(0), Vec3(-1, -2, 3));
}

TEST(FinishTree, EdgeRadiiAreScaledAsPointsAre) {
  PointGraph graph = line();
  graph.edge_radii_mm = {3};
  FileFacts facts;
  facts.state_unit(10, "cm");
  CenterlineFileOptions options;
  options.radius_is_diameter = true;
  const auto tree = finish_tree(std::move(graph), facts, "f", options);
  ASSERT_TRUE(tree);
  EXPECT_EQ(tree->branches[0].radii_mm[0], 15);
}

TEST(FinishTree, ALengthThatLeavesTheRangeOfNumbersIsAnErrorWithItsPoint) {
  PointGraph graph = line();
  graph.points[1].position_mm.x() = 1e12;
  CenterlineFileOptions options;
  options.unit_mm = 1e4;
  const auto tree = finish_tree(std::move(graph), {}, "f", options);
  ASSERT_FALSE(tree);
  EXPECT_EQ(tree.error().what, "a length leaves the range of numbers");
  EXPECT_NE(tree.error().value.find("point b"), std::string::npos);
}

TEST(FinishTree, NotesStandBetweenTheConventionsAndWhatTheGraphAssumed) {
  FileFacts facts;
  facts.notes = {"a note"};
  const CenterlineTree tree = finished(facts, {});
  ASSERT_GE(tree.assumptions.size(), 4u);
  EXPECT_EQ(tree.assumptions[3], "a note");
}

TEST(ParseRadius, SaysWhatIsWrong) {
  EXPECT_EQ(parse_radius("2", "f", 3).value(), 2.0);
  EXPECT_EQ(parse_radius("-2", "f", 3).error().what, "the radius is negative");
  EXPECT_EQ(parse_radius("0", "f", 3).error().what, "the radius is zero");
  EXPECT_EQ(parse_radius("1e-300", "f", 3).error().what, "the radius is out of range");
  EXPECT_EQ(parse_radius("x", "f", 3).error().where, "f:3");
}

TEST(ParsePosition, StopsAtTheFirstBadCoordinate) {
  std::array<std::string_view, 3> fields{"1", "2", "3"};
  const auto field = [&](int k) { return fields[static_cast<std::size_t>(k)]; };
  EXPECT_EQ(parse_position(field, "f", 1).value(), Vec3(1, 2, 3));
  fields = {"1", "two", "three"};
  EXPECT_EQ(parse_position(field, "f", 1).error().value, "'two'");
}

}  // namespace
}  // namespace angiospline
