#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "io/centerlines/centerline_file.h"
#include "io/centerlines/graphml_file.h"
#include "io/centerlines/gxl_file.h"
#include "io/centerlines/network_tables.h"
#include "io/centerlines/rules.h"
#include "io/centerlines/simvascular_file.h"
#include "io/centerlines/swc_file.h"
#include "io/centerlines/tree_definition.h"
#include "io/centerlines/vtk_centerline.h"
#include "io/reading/vtk_polylines.h"
#include "io/text/xml_reader.h"
#include "tests/shapes/paths.h"

namespace angiospline {
namespace {

const std::filesystem::path kSource = testing_paths::source_folder();

// The fuzzers' first files are small examples of every dialect.
std::string corpus(const std::string& file) {
  const auto bytes = read_file(kSource / "tests/fuzz/corpus" / file);
  EXPECT_TRUE(bytes.has_value()) << file;
  return bytes.value_or("");
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

std::string message_of(const Result<CenterlineTree>& tree) {
  return tree ? std::string("no error") : tree.error().message();
}

bool says(const CenterlineTree& tree, std::string_view part) {
  for (const std::string& a : tree.assumptions) {
    if (a.find(part) != std::string::npos) return true;
  }
  return false;
}

void expect_start(const std::string& message, const std::string& start) {
  EXPECT_EQ(message.substr(0, start.size()), start);
}

TEST(TreeDefinition, BranchesAreSampledByTheirRadiiAndHairsMoreCoarsely) {
  const auto points = [](double length, double radius) {
    const std::string text = "node a 0 0 0\nnode b 0 0 " + std::to_string(length) +
                             "\nbranch v a b " + std::to_string(radius) + "\n";
    const auto tree = parse_tree_definition(text, "t.tree");
    return tree ? static_cast<int>(tree->branches.at(0).points_mm.cols()) : 0;
  };
  EXPECT_EQ(points(10, 1), static_cast<int>(std::ceil(10 / kDefinitionSampleRadii)) + 1);
  EXPECT_EQ(points(10, 4), static_cast<int>(std::ceil(10 / (4 * kDefinitionSampleRadii))) + 1);
  EXPECT_EQ(points(1000, 0.1), kDefinitionMostSamples + 1);
}

TEST(TreeDefinition, NodesAndBranchesKeepTheirNamesAndRunSmoothly) {
  const auto tree = parse_tree_definition(corpus("tree/y.tree"), "y.tree");
  ASSERT_TRUE(tree.has_value()) << message_of(tree);
  ASSERT_EQ(tree->branches.size(), 3U);
  EXPECT_EQ(tree->branches[0].name, "t");
  EXPECT_EQ(tree->nodes[std::size_t(tree->branches[1].from)].name, "b");
  EXPECT_EQ(tree->nodes[std::size_t(tree->inlets.at(0))].name, "a");
  EXPECT_DOUBLE_EQ(tree->branches[0].radii_mm(0), 9.0);
  EXPECT_DOUBLE_EQ(tree->branches[1].radii_mm(0), 5.0)
      << "each branch has its own radius at a node";
  EXPECT_GT(tree->branches[1].points_mm.cols(), 10);
}

TEST(TreeDefinition, BadStatementsAreNamed) {
  const auto message = [](const std::string& text) {
    return message_of(parse_tree_definition(text, "t.tree"));
  };
  const std::string nodes = "node a 0 0 0\nnode b 0 0 9\n";
  expect_start(message(nodes + "branch x a c 1\n"), "t.tree:3: the node is not defined: 'c'");
  expect_start(message(nodes + "branch x a b 0\n"), "t.tree:3: the radius is zero: 0");
  expect_start(message(nodes + "branch x a b 1\nbranch x a b 1\n"),
               "t.tree:4: the branch is defined twice: 'x'");
  expect_start(message(nodes + "node a 1 1 1\n"), "t.tree:3: the node is defined twice: 'a'");
  expect_start(message(nodes + "point 0 0 1\n"), "t.tree:3: the point has no branch");
  expect_start(message(nodes + "unit cm\n"), "t.tree:3: the unit comes too late: 'cm'");
  expect_start(message("unit parsec\n"), "t.tree:1: not a unit of length: 'parsec'");
  expect_start(message("brunch x\n"), "t.tree:1: not a known statement: 'brunch'");
  expect_start(message(nodes), "t.tree: defines no branch");
  expect_start(message(nodes + "branch x a a 1\n"), "t.tree:3: the branch has no length: 'x'");
}

TEST(Vtp, EveryEncodingGivesTheSameTree) {
  const auto expected = parse_vtp_centerline(corpus("vtp/ascii.vtp"), "a.vtp");
  ASSERT_TRUE(expected.has_value()) << message_of(expected);
  EXPECT_EQ(expected->branches.size(), 3U) << "two lines that part after two points";
  EXPECT_TRUE(says(*expected, "1 lines merged"));
  for (const char* file : {"vtp/plain.vtp", "vtp/zlib.vtp", "vtp/appended.vtp"}) {
    const auto tree = parse_vtp_centerline(corpus(file), file);
    ASSERT_TRUE(tree.has_value()) << message_of(tree);
    ASSERT_EQ(tree->branches.size(), expected->branches.size());
    for (std::size_t b = 0; b < tree->branches.size(); ++b) {
      ASSERT_EQ(tree->branches[b].points_mm.cols(), expected->branches[b].points_mm.cols());
      EXPECT_LT(
          (tree->branches[b].points_mm - expected->branches[b].points_mm).cwiseAbs().maxCoeff(),
          1e-6);
      EXPECT_EQ(tree->branches[b].radii_mm, expected->branches[b].radii_mm);
    }
  }
}

TEST(Vtp, DamagedFilesAreNamed) {
  const std::string good = corpus("vtp/zlib.vtp");
  const auto message = [](const std::string& text) {
    return message_of(parse_vtp_centerline(text, "a.vtp"));
  };
  expect_start(message(replaced(good, "NumberOfPoints=\"8\"", "NumberOfPoints=\"1000000000\"")),
               "a.vtp:1: the number of points cannot be true: '1000000000'");
  expect_start(message(replaced(good, "NumberOfPoints=\"8\"", "NumberOfPoints=\"9\"")),
               "a.vtp:1: array Points: the data are cut short");
  expect_start(message(replaced(good, "\"Radius\"", "\"Diameter\"")),
               "a.vtp: no point array holds the radius: the point arrays are Diameter");
  expect_start(message(replaced(good, "vtkZLib", "vtkLZ4")),
               "a.vtp:1: the compressor is not supported: 'vtkLZ4DataCompressor'");
  expect_start(message(good.substr(0, good.size() / 2)), "a.vtp:1: ");
  const std::string ascii = corpus("vtp/ascii.vtp");
  expect_start(message(replaced(ascii, ".6 .6", "0 .6")),
               "a.vtp: point 6: the radius is not positive and finite: 0");
  expect_start(message(replaced(ascii, "5 6 7", "5 6 8")),
               "a.vtp:1: array connectivity: the index is out of range: 8");
  expect_start(message(replaced(ascii, "PolyData", "ImageData")), "a.vtp: is not VTK polydata");
}

TEST(LegacyVtk, AsciiAndBinaryAndTheirFrame) {
  const auto ascii = parse_vtk_centerline(corpus("vtk/ascii.vtk"), "a.vtk");
  const auto binary = parse_vtk_centerline(corpus("vtk/binary.vtk"), "b.vtk");
  ASSERT_TRUE(ascii.has_value()) << message_of(ascii);
  ASSERT_TRUE(binary.has_value()) << message_of(binary);
  ASSERT_EQ(ascii->branches.size(), 3U);
  ASSERT_EQ(binary->branches.size(), 3U);
  EXPECT_TRUE(says(*ascii, "frame: RAS, turned into LPS, as the file says"));
  const Points3 turned = Vec3(-1, -1, 1).asDiagonal() * ascii->branches[1].points_mm;
  EXPECT_LT((turned - binary->branches[1].points_mm).cwiseAbs().maxCoeff(), 1e-6);
}

TEST(LegacyVtk, ClaimsBeyondTheFileAreRefused) {
  const auto message = [](const std::string& text) {
    return message_of(parse_vtk_centerline(text, "a.vtk"));
  };
  const std::string good = corpus("vtk/ascii.vtk");
  expect_start(message(replaced(good, "LINES 2 10", "LINES 1000000000 3000000000")),
               "a.vtk:7: the count cannot be true: '1000000000'");
  expect_start(message(replaced(good, "POINTS 8", "POINTS 99999999999999999999")),
               "a.vtk:5: the count cannot be true");
  expect_start(message(replaced(good, "POLYDATA", "STRUCTURED_POINTS")),
               "a.vtk:4: the data set has no lines");
  expect_start(message(good.substr(0, good.size() - 60)), "a.vtk:");
  expect_start(message("hello"), "a.vtk:1: is not a legacy VTK file");
}

TEST(Gxl, PositionsAreInVoxelsAndRadiiInTheirWidth) {
  const auto tree = parse_gxl(corpus("gxl/tree.xml"), "g.xml");
  ASSERT_TRUE(tree.has_value()) << message_of(tree);
  EXPECT_DOUBLE_EQ(tree->nodes[0].position_mm.y(), 2.0);
  EXPECT_DOUBLE_EQ(tree->branches[0].radii_mm(1), 0.086);
  EXPECT_TRUE(says(*tree, "voxel width: 0.04, VascuSynth's default"));
  CenterlineFileOptions options;
  options.voxel_width = 0.1;
  EXPECT_DOUBLE_EQ(parse_gxl(corpus("gxl/tree.xml"), "g", options)->nodes[0].position_mm.y(), 5.0);
  expect_start(
      message_of(parse_gxl(replaced(corpus("gxl/tree.xml"), "to=\"n1\"", "to=\"n7\""), "g")),
      "g:1: the edge's node does not exist: n7");
  expect_start(message_of(parse_gxl(replaced(corpus("gxl/tree.xml"), "0.086", "-1"), "g")),
               "g:1: the radius is negative: -1");
}

TEST(Graphml, IsReadAndWrittenWithLoopsAndOwnRadii) {
  const auto small = parse_graphml(corpus("graphml/tree.graphml"), "g");
  ASSERT_TRUE(small.has_value()) << message_of(small);
  EXPECT_DOUBLE_EQ(small->branches[0].radii_mm(0), 1.5) << "undirected: from the widest end";
  const auto ring = read_centerline_file(kSource / "samples/circle_of_willis.csv");
  ASSERT_TRUE(ring.has_value()) << message_of(ring);
  const auto again = parse_graphml(graphml_text(*ring), "g");
  ASSERT_TRUE(again.has_value()) << message_of(again);
  EXPECT_EQ(cycle_count(*again), 1);
  EXPECT_EQ(again->inlets.size(), 3U);
  ASSERT_EQ(again->branches.size(), ring->branches.size());
  for (const CenterlineBranch& b : ring->branches) {
    bool found = false;
    for (const CenterlineBranch& c : again->branches) {
      if (b.name != c.name || b.points_mm.cols() != c.points_mm.cols()) continue;
      const bool same = b.points_mm == c.points_mm && b.radii_mm == c.radii_mm;
      const bool turned = b.points_mm == Points3(c.points_mm.rowwise().reverse()) &&
                          b.radii_mm == Eigen::VectorXd(c.radii_mm.reverse());
      found = same || turned;
    }
    EXPECT_TRUE(found) << b.name;
  }
}

TEST(NetworkTables, EdgesHaveTheirRadiiAndPairsOfFilesFindEachOther) {
  const std::string both = corpus("tables/tables.txt");
  const std::size_t cut = both.find("====");
  const auto folder = std::filesystem::temp_directory_path() / "angiospline_network_tables";
  std::filesystem::create_directories(folder);
  ASSERT_TRUE(write_file(folder / "vertices.csv", both.substr(0, cut)));
  ASSERT_TRUE(write_file(folder / "edges.csv", both.substr(cut + 4)));
  for (const auto& path : {folder / "vertices.csv", folder / "edges.csv", folder}) {
    const auto tree = read_centerline_file(path);
    ASSERT_TRUE(tree.has_value()) << message_of(tree);
    ASSERT_EQ(tree->branches.size(), 3U);
    EXPECT_EQ(tree->branches[0].name, "0_1");
    EXPECT_DOUBLE_EQ(tree->branches[1].radii_mm(0), 1.5);
    EXPECT_DOUBLE_EQ(tree->branches[2].radii_mm(0), 1.75) << "the mean of its neighbours";
    EXPECT_TRUE(says(*tree, "1 edges without a positive radius"));
  }
  std::filesystem::remove(folder / "edges.csv");
  expect_start(message_of(read_centerline_file(folder / "vertices.csv")),
               (folder / "vertices.csv").string() + ": the other table of the network is missing");
  std::filesystem::remove_all(folder);
}

TEST(SimVascular, ContoursGiveCirclesOfTheirArea) {
  const auto group = parse_ctgr(corpus("simvascular/v.ctgr"), "v.ctgr");
  ASSERT_TRUE(group.has_value()) << group.error().message();
  ASSERT_EQ(group->contours.size(), 3U);
  EXPECT_NEAR(group->contours[1].radius, std::sqrt(2 / 3.14159265358979), 1e-9)
      << "a square of area 2";
  EXPECT_LT((group->contours[2].center - Vec3(0, 0, 2)).norm(), 1e-12);
  const auto path = parse_pth(corpus("simvascular/v.pth"), "v.pth");
  ASSERT_TRUE(path.has_value());
  EXPECT_EQ(path->size(), 12U);
}

TEST(SimVascular, APathNeedsItsContoursAndIsCutToThem) {
  const auto folder = std::filesystem::temp_directory_path() / "angiospline_simvascular";
  std::filesystem::create_directories(folder);
  ASSERT_TRUE(write_file(folder / "v.pth", corpus("simvascular/v.pth")));
  expect_start(message_of(read_centerline_file(folder / "v.pth")),
               (folder / "v.pth").string() + ": a path has no radii");
  ASSERT_TRUE(write_file(folder / "v.ctgr", corpus("simvascular/v.ctgr")));
  const auto tree = read_centerline_file(folder / "v.pth");
  ASSERT_TRUE(tree.has_value()) << message_of(tree);
  ASSERT_EQ(tree->branches.size(), 1U);
  EXPECT_GE(tree->branches[0].points_mm.cols(), 11);
  EXPECT_NEAR(length_mm(tree->branches[0]), 20.0, 1e-9) << "from contour 0 to contour 10, in mm";
  std::filesystem::remove_all(folder);
}

TEST(Xml, BombsAndBrokenMarkupAreRefused) {
  const auto message = [](std::string_view text) {
    XmlReader xml(text, "x");
    while (true) {
      const auto event = xml.next();
      if (!event) return event.error().message();
      if (*event == XmlReader::Event::kDone) return std::string("no error");
    }
  };
  expect_start(message("<!DOCTYPE a [<!ENTITY b \"bb\">]><a>&b;</a>"),
               "x:1: the document type defines entities");
  EXPECT_EQ(message("<!DOCTYPE gxl SYSTEM \"http://x/gxl.dtd\"><a/>"), "no error");
  expect_start(message("<a>&b;</a>"), "x:1: an unknown entity: 'b'");
  expect_start(message("<a>\n<b></a>"), "x:2: an element ends that is not open: 'a'");
  expect_start(message("<a>\n\n"), "x:3: the file stops inside an element: 'a'");
  expect_start(message("<a b=c/>"), "x:1: an attribute without a quoted value");
  expect_start(message("<a"), "x:1: a tag without an end");
  std::string deep;
  for (int i = 0; i < 200; ++i) deep += "<a>";
  expect_start(message(deep), "x:1: too many open elements");
  EXPECT_EQ(message("<a><![CDATA[ <b> ]]></a><c d='&#x41;&lt;'/>"), "no error");
}

TEST(Samples, AreReadWithTheirNames) {
  const auto tree = read_centerline_file(kSource / "samples/figure_7_18.swc");
  ASSERT_TRUE(tree.has_value()) << message_of(tree);
  EXPECT_EQ(tree->nodes.size(), 10U) << "as the figure prints them";
  EXPECT_EQ(tree->branches.size(), 9U);
  EXPECT_EQ(tree->branches[0].name, "100_101");
  const auto ring = read_centerline_file(kSource / "samples/circle_of_willis.csv");
  ASSERT_TRUE(ring.has_value()) << message_of(ring);
  EXPECT_EQ(cycle_count(*ring), 1);
  EXPECT_EQ(ring->inlets.size(), 3U);
  EXPECT_EQ(ring->branches[0].name, "basilar");
  const auto graft = read_centerline_file(kSource / "samples/y_graft.tree");
  ASSERT_TRUE(graft.has_value()) << message_of(graft);
  EXPECT_EQ(graft->branches.size(), 5U);
}

struct RealFile {
  const char* path;
  std::size_t branches;
  int cycles;
};

class real_data_Centerlines : public ::testing::TestWithParam<RealFile> {};

TEST_P(real_data_Centerlines, AreReadWithTheirBranchesAndLoops) {
  const char* const folder = std::getenv("ANGIOSPLINE_DATA");
  if (folder == nullptr) GTEST_SKIP() << "ANGIOSPLINE_DATA is not set";
  const auto path = std::filesystem::path(folder) / "centerlines" / GetParam().path;
  const auto tree = read_centerline_file(path);
  ASSERT_TRUE(tree.has_value()) << message_of(tree);
  EXPECT_EQ(tree->branches.size(), GetParam().branches);
  EXPECT_EQ(cycle_count(*tree), GetParam().cycles);
  EXPECT_EQ(component_count(*tree), 1);
  EXPECT_EQ(tree->inlets.size(), 1U);
  EXPECT_TRUE(says(*tree, "unit: "));
}

INSTANTIATE_TEST_SUITE_P(, real_data_Centerlines,
                         ::testing::Values(RealFile{"BH0005.swc", 137, 0},
                                           RealFile{"BG07.swc", 241, 0},
                                           RealFile{"example_centerline_ICA.swc", 5, 0},
                                           RealFile{"aorta-centerline.vtp", 3, 0},
                                           RealFile{"aorta-centerline-branches.vtp", 3, 0},
                                           RealFile{"carotid_left_centerline.vtp", 3, 0},
                                           RealFile{"vascusynth_N200_tree_structure.xml", 399, 0},
                                           RealFile{"aorta.ctgr", 1, 0}, RealFile{".", 3, 0},
                                           RealFile{"vesselvio", 3227, 53}));

}  // namespace
}  // namespace angiospline
