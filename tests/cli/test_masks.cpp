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
