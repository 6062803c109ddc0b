#include <clocale>
#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "io/centerlines/centerline_file.h"
#include "io/centerlines/csv_centerline.h"
#include "io/centerlines/swc_file.h"

namespace angiospline {
namespace {

const char* const kTree =
    "# a stem and two daughters\n"
    "1 1 0 0 0 2 -1\n"
    "2 3 0 0 5 2 1\n"
    "3 3 0 0 10 2 2\n"
    "4 3 3 0 15 1.5 3\n"
    "5 3 6 0 20 1.5 4\n"
    "6 3 -3 0 15 1.0 3\n";

CenterlineTree tree_of(std::string_view swc) {
  const auto tree = parse_swc(swc, "t.swc");
  EXPECT_TRUE(tree.has_value()) << (tree ? "" : tree.error().message());
  return tree.value_or(CenterlineTree{});
}

std::string message_of(const Result<CenterlineTree>& tree) {
  return tree ? std::string("no error") : tree.error().message();
}

std::string swc_message(std::string_view text) { return message_of(parse_swc(text, "t.swc")); }
std::string csv_message(std::string_view text) {
  return message_of(parse_csv_centerline(text, "t.csv"));
}

bool says(const CenterlineTree& tree, std::string_view part) {
  for (const std::string& a : tree.assumptions) {
    if (a.find(part) != std::string::npos) return true;
  }
  return false;
}

TEST(Swc, ChainsBecomeBranchesNamedByTheIdsOfTheirNodes) {
  const CenterlineTree tree = tree_of(kTree);
  ASSERT_EQ(tree.nodes.size(), 4U);
  ASSERT_EQ(tree.branches.size(), 3U);
  EXPECT_EQ(tree.branches[0].name, "1_3");
  EXPECT_EQ(tree.branches[1].name, "3_5");
  EXPECT_EQ(tree.branches[2].name, "3_6");
  EXPECT_EQ(tree.branches[1].points_mm.cols(), 3);
  EXPECT_EQ(tree.branches[1].points_mm.col(2), Vec3(6, 0, 20));
  EXPECT_EQ(tree.branches[1].radii_mm(1), 1.5);
  ASSERT_EQ(tree.inlets.size(), 1U);
  EXPECT_EQ(tree.nodes[static_cast<std::size_t>(tree.inlets[0])].name, "1");
  EXPECT_TRUE(says(tree, "unit: mm (the file does not say"));
}

TEST(Swc, LineEndsByteOrderMarksAndTabsDoNotMatter) {
  const CenterlineTree expected = tree_of(kTree);
  for (const std::string end : {"\r\n", "\r"}) {
    std::string text = "\xEF\xBB\xBF";
    for (const char* c = kTree; *c != 0; ++c)
      text += *c == '\n' ? end : *c == ' ' ? "\t" : std::string(1, *c);
    const CenterlineTree tree = tree_of(text);
    ASSERT_EQ(tree.branches.size(), expected.branches.size());
    EXPECT_EQ(tree.branches[1].points_mm, expected.branches[1].points_mm);
  }
}

TEST(Swc, ParentsMayComeLaterAndIdsMayHaveGaps) {
  const CenterlineTree tree = tree_of("70 3 0 0 2 1 30\n30 3 0 0 1 1 5\n5 1 0 0 0 1 0\n");
  ASSERT_EQ(tree.branches.size(), 1U);
  EXPECT_EQ(tree.branches[0].name, "5_70");
  EXPECT_TRUE(says(tree, "parent 0: a root"));
}

TEST(Swc, IdZeroIsAPointWhereItExists) {
  const CenterlineTree tree = tree_of("0 1 0 0 0 1 -1\n1 3 0 0 1 1 0\n2 3 0 0 2 1 1\n");
  ASSERT_EQ(tree.branches.size(), 1U);
  EXPECT_EQ(tree.branches[0].name, "0_2");
}

TEST(Swc, ARepeatedPositionAtAnEndClosesALoop) {
  const CenterlineTree tree = tree_of(
      "1 1 0 0 0 1 -1\n2 3 5 0 0 1 1\n3 3 10 5 0 1 2\n4 3 15 0 0 1 3\n5 3 10 -5 0 1 2\n"
      "6 3 15 0 0 1 5\n7 3 20 0 0 1 4\n");
  EXPECT_EQ(cycle_count(tree), 1);
  EXPECT_EQ(tree.nodes.size(), 4U);
  EXPECT_EQ(tree.branches.size(), 4U);
  EXPECT_TRUE(says(tree, "joined to it: 4 and 6"));
  EXPECT_NE(tree.branches[1].name, tree.branches[2].name);
}

TEST(Swc, DaughtersThatRepeatTheirFirstPointShareIt) {
  // As the BraVa files are: both daughters copy the point after the parent's last.
  const CenterlineTree tree = tree_of(
      "1 0 0 0 0 2 -1\n2 0 0 0 0 2 1\n3 0 0 0 5 2 2\n4 0 0 0 6 2 3\n5 0 0 0 6 1 3\n"
      "6 0 3 0 9 2 4\n7 0 -3 0 9 1 5\n");
  ASSERT_EQ(tree.branches.size(), 3U);
  EXPECT_EQ(tree.branches[0].name, "1_4");
  EXPECT_EQ(tree.branches[2].radii_mm(0), 1.0) << "each daughter keeps the radius of its own copy";
  EXPECT_TRUE(says(tree, "1 edge of zero length removed"));
}

TEST(Swc, SeveralRootsAreSeveralComponents) {
  const CenterlineTree tree =
      tree_of("1 1 0 0 0 1 -1\n2 3 0 0 5 1 1\n3 1 50 0 0 1 -1\n4 3 50 0 5 1 3\n");
  EXPECT_EQ(component_count(tree), 2);
  EXPECT_EQ(tree.inlets.size(), 2U);
}

TEST(Swc, ARootInMidVesselLeavesTheWidestEndAsInlet) {
  const CenterlineTree tree = tree_of("1 1 0 0 0 1 -1\n2 3 0 0 5 1 1\n3 3 0 0 -5 2 1\n");
  ASSERT_EQ(tree.branches.size(), 1U);
  EXPECT_EQ(tree.branches[0].name, "3_2");
  EXPECT_TRUE(says(tree, "taken to be 3"));
}

TEST(Swc, UnitsDiametersAndFramesAreAppliedAndSaid) {
  CenterlineFileOptions options;
  options.unit_mm = 1e-3;
  options.radius_is_diameter = true;
  options.frame = CoordinateFrame::kRas;
  const auto tree = parse_swc("1 1 1000 2000 0 500 -1\n2 1 1000 2000 3000 500 1\n", "t", options);
  ASSERT_TRUE(tree.has_value());
  EXPECT_EQ(tree->nodes[0].position_mm, Vec3(-1, -2, 0));
  EXPECT_DOUBLE_EQ(tree->branches[0].radii_mm(0), 0.25);
  EXPECT_TRUE(says(*tree, "unit: 0.001 mm, as given"));
  EXPECT_TRUE(says(*tree, "diameters, as given"));
  EXPECT_TRUE(says(*tree, "frame: RAS, turned into LPS, as given"));
}

TEST(Swc, AUnitInAHeaderCommentIsBelieved) {
  const CenterlineTree tree = tree_of("# units in um\n1 1 0 0 0 500 -1\n2 1 0 0 3000 500 1\n");
  EXPECT_DOUBLE_EQ(tree.branches[0].radii_mm(0), 0.5);
  EXPECT_TRUE(says(tree, "unit: um, as the file says"));
}

TEST(Swc, BadLinesAreNamedWithPlaceValueAndRule) {
  const std::string start = "1 1 0 0 0 1 -1\n";
  EXPECT_EQ(swc_message(start + "2 1 0 0 5 1\n"),
            "t.swc:2: the line is cut short: 6 values (a line is: id type x y z radius parent)");
  EXPECT_EQ(swc_message(start + "2 1 0 x 5 1 1\n"),
            "t.swc:2: the coordinate is not a finite number: 'x' (numbers are written like -1.5 or "
            "2e-3)");
  for (const char* value : {"nan", "inf", "-inf", "1e999", "1,5", "0x1p3"}) {
    EXPECT_EQ(swc_message(start + "2 1 0 0 " + value + " 1 1\n").find("t.swc:2: the coordinate"),
              0U)
        << value;
    EXPECT_EQ(swc_message(start + "2 1 0 0 5 " + value + " 1\n").find("t.swc:2: the radius"), 0U)
        << value;
  }
  EXPECT_EQ(swc_message(start + "2 1 0 0 5 -0.5 1\n"),
            "t.swc:2: the radius is negative: -0.5 (radii are positive, from 1e-12 to 1e+12)");
  EXPECT_EQ(swc_message(start + "2 1 0 0 5 0 1\n").find("t.swc:2: the radius is zero: 0"), 0U);
  EXPECT_EQ(swc_message(start + "2 1 0 0 5 1 9\n"),
            "t.swc:2: the parent does not exist: 9 (a parent is the id of a point of this file, or "
            "-1 for a root)");
  EXPECT_EQ(swc_message(start + "1 1 0 0 5 1 1\n"),
            "t.swc:2: the id is used twice: 1 (ids are unique; line 1 has it too)");
  EXPECT_EQ(swc_message(start + "2 1 0 0 5 1 3\n3 1 0 0 6 1 2\n"),
            "t.swc:2: the point is its own ancestor: 2 (parents lead to a root, without a cycle)");
  EXPECT_EQ(swc_message(start + "2 1 0 0 0 1 1\n"),
            "t.swc: no branch has a positive length (two points at different positions must be "
            "connected)");
  EXPECT_EQ(swc_message("# nothing\n"),
            "t.swc: holds no point (a line is: id type x y z radius parent)");
  EXPECT_EQ(swc_message(""), "t.swc: is empty (there must be at least one point)");
  EXPECT_EQ(
      swc_message(start + "2 1 1e300 0 0 1 1\n").find("t.swc:2: the coordinate is absurdly large"),
      0U);
  EXPECT_EQ(swc_message("\xFF\xFE"
                        "1")
                .find("t.swc: is UTF-16 text"),
            0U);
  EXPECT_EQ(swc_message(std::string("1 1 0 \0 0 1 -1", 14)).find("t.swc: is not text"), 0U);
}

TEST(Swc, TheWriterIsReadBackToTheSameTree) {
  const CenterlineTree loop = tree_of(
      "1 1 0 0 0 1 -1\n2 3 5 0 0 1 1\n3 3 10 5 0 1 2\n4 3 15 0 0 1 3\n5 3 10 -5 0 .5 2\n"
      "6 3 15 0 0 .5 5\n7 3 20 0 0 1 4\n8 1 100 0 0 3 -1\n9 1 100 .1 0 3 8\n");
  for (const CenterlineTree& tree : {tree_of(kTree), loop}) {
    const CenterlineTree again = tree_of(swc_text(tree));
    ASSERT_EQ(again.nodes.size(), tree.nodes.size());
    ASSERT_EQ(again.branches.size(), tree.branches.size());
    EXPECT_EQ(cycle_count(again), cycle_count(tree));
    for (const CenterlineBranch& b : tree.branches) {
      bool found = false;
      for (const CenterlineBranch& c : again.branches) {
        found = found || (c.points_mm.cols() == b.points_mm.cols() && c.points_mm == b.points_mm &&
                          c.radii_mm == b.radii_mm);
      }
      EXPECT_TRUE(found) << b.name;
    }
  }
}

TEST(Csv, HeadersSeparatorsAndDecimalCommasAreUnderstood) {
  const char* const texts[] = {
      "x,y,z,radius\n0,0,0,1\n0,0,2.5,1\n0,0,5,1\n",
      "x;y;z;radius\n0;0;0;1\n0;0;2,5;1\n0;0;5;1\n",
      "Radius\tX\tY\tZ\n1\t0\t0\t0\n1\t0\t0\t2.5\n1\t0\t0\t5\n",
      "0 0 0 1\n0 0 2.5 1\n0 0 5 1\n",
      "\"pos_x\",\"pos_y\",\"pos_z\",\"diameter\"\n0,0,0,2\n0,0,2.5,2\n0,0,5,2\n",
      "id,parent,x_mm,y_mm,z_mm,r\na,,0,0,0,1\nb,a,0,0,2.5,1\nc,b,0,0,5,1\n",
      "0,0,0,1,-1\n0,0,2.5,1,0\n0,0,5,1,1\n",
      "0,0,0,1,-1\n0,0,2.5,1,1\n0,0,5,1,2\n"};
  for (const char* text : texts) {
    const auto tree = parse_csv_centerline(text, "t.csv");
    ASSERT_TRUE(tree.has_value()) << text << tree.error().message();
    ASSERT_EQ(tree->branches.size(), 1U) << text;
    ASSERT_EQ(tree->branches[0].points_mm.cols(), 3) << text;
    EXPECT_EQ(tree->branches[0].points_mm.col(1), Vec3(0, 0, 2.5)) << text;
    EXPECT_EQ(tree->branches[0].radii_mm(1), 1.0) << text;
    EXPECT_EQ(tree->inlets.size(), 1U) << text;
  }
}

TEST(Csv, BranchesJoinWhereTheyShareAPosition) {
  const char* const rows =
      "0,0,0,2,a\n0,0,5,2,a\n0,0,10,2,a\n0,0,10,1,b\n5,0,15,1,b\n0,0,10,1,c\n-5,0,15,1,c\n";
  for (const std::string header : {"x,y,z,radius,branch\n", ""}) {
    const auto tree = parse_csv_centerline(header + rows, "t.csv");
    ASSERT_TRUE(tree.has_value()) << tree.error().message();
    EXPECT_EQ(tree->branches.size(), 3U);
    EXPECT_EQ(tree->nodes.size(), 4U);
    EXPECT_EQ(tree->branches[1].radii_mm(0), 1.0);
  }
}

TEST(Csv, TheWriterIsReadBackToTheSameBranches) {
  const CenterlineTree tree = tree_of(kTree);
  const auto again = parse_csv_centerline(csv_text(tree), "t.csv");
  ASSERT_TRUE(again.has_value()) << again.error().message();
  ASSERT_EQ(again->branches.size(), tree.branches.size());
  for (std::size_t b = 0; b < tree.branches.size(); ++b) {
    EXPECT_EQ(again->branches[b].points_mm, tree.branches[b].points_mm);
    EXPECT_EQ(again->branches[b].radii_mm, tree.branches[b].radii_mm);
  }
}

TEST(Csv, BadRowsAreNamedWithPlaceValueAndRule) {
  EXPECT_EQ(csv_message("x,y,z,radius\n0,0,0,1\n0,0,5\n"),
            "t.csv:3: the row is cut short: 3 values (every row has 4)");
  EXPECT_EQ(
      csv_message("x,y,z,radius\n0,0,0,1\n0,0,5,-1\n").find("t.csv:3: the radius is negative: -1"),
      0U);
  EXPECT_EQ(
      csv_message("x,y,z\n0,0,0\n").find("t.csv:1: the header line names no x, y, z and radius"),
      0U);
  EXPECT_EQ(csv_message("0,0\n").find("t.csv:1: the columns cannot be told"), 0U);
  EXPECT_EQ(csv_message("0,0,0,1,3\n0,0,1,1,2\n0,0,2,1,3\n")
                .find("t.csv:1: the fifth column cannot be told"),
            0U);
  EXPECT_EQ(csv_message("id,parent,x,y,z,r\n1,-1,0,0,0,1\n2,7,0,0,1,1\n")
                .find("t.csv:3: the parent does not exist: 7"),
            0U);
  EXPECT_EQ(csv_message("id,parent,x,y,z,r\n1,2,0,0,0,1\n2,1,0,0,1,1\n")
                .find("t.csv:2: the point is its own ancestor"),
            0U);
  EXPECT_EQ(csv_message("id,parent,x,y,z,r\n1,-1,0,0,0,1\n1,1,0,0,1,1\n")
                .find("t.csv:3: the id is used twice"),
            0U);
  EXPECT_EQ(csv_message("x,y,z,radius\n").find("t.csv: holds no point"), 0U);
}

TEST(CenterlineFile, TheSuffixDecidesAndMissingFilesAreNamed) {
  EXPECT_EQ(message_of(read_centerline_file("/nowhere/a.swc")), "/nowhere/a.swc: no such file");
  EXPECT_EQ(message_of(read_centerline_file("/tmp/a.doc")).find("/tmp/a.doc: not a known format"),
            0U);
  const auto path = std::filesystem::temp_directory_path() / "angiospline_centerline_file_test.swc";
  ASSERT_TRUE(write_file(path, kTree).has_value());
  const auto tree = read_centerline_file(path);
  std::filesystem::remove(path);
  ASSERT_TRUE(tree.has_value());
  EXPECT_EQ(tree->source, path.string());
}

TEST(CenterlineFile, UnitsAreLengthsWithNames) {
  EXPECT_DOUBLE_EQ(*parse_unit_mm("mm"), 1.0);
  EXPECT_DOUBLE_EQ(*parse_unit_mm("m"), 1000.0);
  EXPECT_DOUBLE_EQ(*parse_unit_mm("um"), 1e-3);
  EXPECT_DOUBLE_EQ(*parse_unit_mm("Micrometers"), 1e-3);
  EXPECT_DOUBLE_EQ(*parse_unit_mm("0.04mm"), 0.04);
  EXPECT_DOUBLE_EQ(*parse_unit_mm("2.5 cm"), 25.0);
  EXPECT_DOUBLE_EQ(*parse_unit_mm("0.04"), 0.04);
  for (const char* text : {"", "parsec", "-1mm", "0", "nan", "mm2"}) {
    EXPECT_FALSE(parse_unit_mm(text).has_value()) << text;
  }
}

TEST(CenterlineFile, NumbersDoNotDependOnTheLocale) {
  const std::string before = std::setlocale(LC_ALL, nullptr);
  for (const char* name : {"de_DE.UTF-8", "fr_FR.UTF-8", "C.UTF-8"}) {
    if (std::setlocale(LC_ALL, name) == nullptr) continue;
    const CenterlineTree tree = tree_of("1 1 0 0 0 1.5 -1\n2 1 0 0 2.25 1.5 1\n");
    EXPECT_EQ(tree.branches[0].points_mm(2, 1), 2.25) << name;
    EXPECT_NE(swc_text(tree).find("0 0 2.25 1.5"), std::string::npos) << name;
  }
  std::setlocale(LC_ALL, before.c_str());
}

}  // namespace
}  // namespace angiospline
