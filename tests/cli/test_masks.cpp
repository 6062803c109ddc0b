// The stages from image to graph as commands, and the comparison of masks.
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/cli/run_program.h"

namespace angiospline::test {
namespace {

using nlohmann::json;

std::string text_of(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

class Masks : public testing::Test {
 protected:
  void make(const std::string& kind, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{
        "phantom", kind, "-o", folder_ / "image.nrrd", "--truth", folder_ / "truth.nrrd"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramRun run = run_angiospline(arguments);
    ASSERT_EQ(run.exit_code, 0) << run.err;
  }

  json figures(const std::vector<std::string>& arguments) {
    const ProgramRun run = run_angiospline(arguments);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return json::parse(run.out, nullptr, false);
  }

  TemporaryFolder folder_;
};

TEST_F(Masks, CompareMasksGivesEveryFigureOfAMaskAndItself) {
  make("bifurcation");
  const std::string truth = folder_ / "truth.nrrd";
  const json j = figures({"compare-masks", truth, truth, "--json"});
  EXPECT_EQ(j["dice"], 1.0);
  EXPECT_EQ(j["missed_voxels"], 0);
  EXPECT_EQ(j["missed_percent"], 0.0);
  EXPECT_EQ(j["assd_mm"], 0.0);
  EXPECT_EQ(j["hausdorff95_mm"], 0.0);
  EXPECT_EQ(j["centerline_dice"], 1.0);
  EXPECT_EQ(j["centerline"]["overlap"], 1.0);
  EXPECT_EQ(j["truth"], (json{{"components", 1}, {"cavities", 0}, {"cycles", 0}}));
  EXPECT_EQ(j["same_place"], true);
}

TEST_F(Masks, CompareMasksMeasuresASegmentationOfNoise) {
  make("bifurcation", {"--snr", "8"});
  ASSERT_EQ(
      run_angiospline({"segment", folder_ / "image.nrrd", "-o", folder_ / "mask.nrrd"}).exit_code,
      0);
  const json j =
      figures({"compare-masks", folder_ / "truth.nrrd", folder_ / "mask.nrrd", "--json"});
  EXPECT_GT(j["dice"], 0.96);
  EXPECT_LT(j["dice"], 1.0);
  EXPECT_LT(j["assd_mm"], 0.5);
  EXPECT_GT(j["centerline"]["overlap"], 0.95);
  EXPECT_EQ(j["result"]["cycles"], 0);
  const ProgramRun table =
      run_angiospline({"compare-masks", folder_ / "truth.nrrd", folder_ / "mask.nrrd"});
  EXPECT_NE(table.out.find("Dice"), std::string::npos);
  EXPECT_NE(table.out.find("centerline overlap"), std::string::npos);
}

TEST_F(Masks, CompareMasksRefusesGridsOfDifferentSize) {
  make("bifurcation");
  std::filesystem::rename(folder_ / "truth.nrrd", folder_ / "large.nrrd");
  make("cylinder");
  const ProgramRun run =
      run_angiospline({"compare-masks", folder_ / "large.nrrd", folder_ / "truth.nrrd"});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_TRUE(is_one_line(run.err)) << run.err;
  EXPECT_NE(run.err.find("128x128x128 and 64x64x64"), std::string::npos) << run.err;
}

// A bar along y that fades in its middle: the volume alone stops there, two X-ray views go on.
TEST_F(Masks, SegmentGrowsThroughAGapWithXrayViews) {
  std::string volume, view;
  for (int z = 0; z < 24; ++z)
    for (int y = 0; y < 24; ++y)
      for (int x = 0; x < 24; ++x) {
        const bool bar = (x - 11.5) * (x - 11.5) + (z - 11.5) * (z - 11.5) <= 9.5;
        volume.push_back(static_cast<char>(!bar ? 20 : y >= 10 && y <= 13 ? 100 : 120));
      }
  for (int row = 0; row < 65; ++row)
    for (int column = 0; column < 65; ++column)
      view.push_back(static_cast<char>(std::abs(column - 32) <= 4 ? 120 : 10));
  const auto mha = [](const char* size, int dimensions) {
    return std::string("ObjectType = Image\nNDims = ") + std::to_string(dimensions) +
           "\nDimSize = " + size + "\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n";
  };
  folder_.write("volume.mha", mha("24 24 24", 3) + volume);
  folder_.write("view.mha", mha("65 65", 2) + view);
  const std::string arm = R"("image": "view.mha", "centre_mm": [11.5, 11.5, 11.5],
      "source_to_centre_mm": 750, "source_to_detector_mm": 1000, "pixel_mm": 1)";
  folder_.write("views.json", R"({"schema": 1, "views": [{"angle_deg": 0, )" + arm +
                                  R"(}, {"angle_deg": 90, )" + arm + "}]}");
  const json j = figures({"segment", folder_ / "volume.mha", "--xray", folder_ / "views.json",
                          "--seed", "11,3,11", "--background", "50", "--world-spacing", "1", "-o",
                          folder_ / "mask.nrrd", "--json"});
  EXPECT_GT(j["by_views"], 50);
  EXPECT_GT(j["voxels"], 550);  // 24 slices of 32 voxels; without the views ten slices
  EXPECT_LT(j["voxels"], 900);
  const ProgramRun run = run_angiospline({"segment", folder_ / "volume.mha", "--xray",
                                          folder_ / "views.json", "-o", folder_ / "m.nrrd"});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_NE(run.err.find("--background"), std::string::npos) << run.err;
}

TEST_F(Masks, GraphWritesEveryFormatAndTheThesisTable) {
  make("bifurcation");
  const ProgramRun run =
      run_angiospline({"graph", folder_ / "truth.nrrd", "--table", "-o", folder_ / "tree.swc",
                       folder_ / "tree.graphml", folder_ / "tree.vtp", folder_ / "tree.csv"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_NE(run.out.find("Parent"), std::string::npos) << run.out;
  EXPECT_NE(run.out.find("Child"), std::string::npos) << run.out;
  EXPECT_NE(text_of(folder_ / "tree.graphml").find("attr.name=\"radius\""), std::string::npos);
  EXPECT_NE(text_of(folder_ / "tree.vtp").find("MaximumInscribedSphereRadius"), std::string::npos);
  // Each is read back as the same three branches.
  for (const char* name : {"tree.swc", "tree.graphml", "tree.vtp", "tree.csv"}) {
    const json j = figures({"seed", folder_ / name, "-o", folder_ / "m.json", "--json"});
    EXPECT_EQ(j["branches"], 3) << name;
    EXPECT_EQ(j["junctions"], 1) << name;
  }
}

}  // namespace
}  // namespace angiospline::test
