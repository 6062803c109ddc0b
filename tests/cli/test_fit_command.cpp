// angiospline fit: a model and its image in, the fitted model and its figures out.
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/image_file.h"
#include "io/model_file.h"
#include "tests/cli/run_program.h"

namespace angiospline::test {
namespace {

class Fit : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(
        run_angiospline({"phantom", "bent-vessel", "--snr", "8", "-o", folder_ / "image.nrrd",
                         "--truth", folder_ / "truth.nrrd", "--truth-tree", folder_ / "tree.swc"})
            .exit_code,
        0);
    ASSERT_EQ(
        run_angiospline({"seed", folder_ / "tree.swc", "-o", folder_ / "seed.json"}).exit_code, 0);
  }

  ProgramRun fit(std::vector<std::string> more = {}) const {
    std::vector<std::string> arguments{"fit", folder_ / "seed.json", folder_ / "image.nrrd", "-o",
                                       folder_ / "out.json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_angiospline(arguments);
  }

  TemporaryFolder folder_;
};

TEST_F(Fit, WritesTheModelItsResidualAndItsDistanceFromTheTruth) {
  const ProgramRun run =
      fit({"--truth", folder_ / "truth.nrrd", "--residual", folder_ / "residual.glb", "--json"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto json = nlohmann::json::parse(run.out);
  EXPECT_NEAR(json["fit"]["snr"], 8, 1);
  EXPECT_LT(json["fit"]["mean_residual_mm"], 0.1);
  EXPECT_LT(json["truth"]["missed_percent"], 10);  // 6.5 are its round ends, cut flat here
  EXPECT_GT(json["truth"]["dice"], 0.95);
  EXPECT_LT(json["check"]["max_normal_angle_deg"], 0.01);
  EXPECT_TRUE(json["check"]["valid"]);
  EXPECT_TRUE(read_model(folder_ / "out.json"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "residual.glb"));
}

TEST_F(Fit, RefinesAModelAsItIsWithoutCapture) {
  const ProgramRun run = fit({"--no-capture", "--json"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(nlohmann::json::parse(run.out)["fit"]["mean_axis_move_mm"], 0.0);
}

TEST_F(Fit, SaysInOneLineWhatIsWrong) {
  const auto refused = [&](std::vector<std::string> arguments, const std::string& word) {
    const ProgramRun run = run_angiospline(arguments);
    EXPECT_EQ(run.exit_code, 2) << run.err;
    EXPECT_TRUE(is_one_line(run.err)) << run.err;
    EXPECT_NE(run.err.find(word), std::string::npos) << run.err;
  };
  const std::string seed = folder_ / "seed.json", image = folder_ / "image.nrrd";
  const std::string out = folder_ / "no.json";

  Image<float> moved{ImageGrid{{8, 8, 8}, Vec3::Ones(), Vec3::Constant(900), Mat3::Identity()}};
  for (std::size_t i = 0; i < moved.voxels.size(); ++i) moved.voxels[i] = static_cast<float>(i % 7);
  ASSERT_TRUE(write_image(moved, folder_ / "apart.nrrd"));
  refused({"fit", seed, folder_ / "apart.nrrd", "-o", out}, "outside the image");

  Image<float> flat(moved.grid, 5.0F);
  ASSERT_TRUE(write_image(flat, folder_ / "flat.nrrd"));
  refused({"fit", seed, folder_ / "flat.nrrd", "-o", out}, "flat.nrrd: the image is constant");

  flat.voxels[3] = std::numeric_limits<float>::quiet_NaN();
  ASSERT_TRUE(write_image(flat, folder_ / "nan.nrrd"));
  refused({"fit", seed, folder_ / "nan.nrrd", "-o", out}, "nan.nrrd, voxel (3, 0, 0)");

  refused({"fit", seed, image, "-o", out, "--truth", folder_ / "apart.nrrd"},
          "apart.nrrd: the truth is not of the image's size");
  refused({"fit", folder_ / "tree.swc", image, "-o", out}, "only a native model can be fitted");
  refused({"fit", seed, image, "-o", out, "--residual", folder_ / "r.stl"}, ".glb or .vtp");
  EXPECT_FALSE(std::filesystem::exists(out));
}

}  // namespace
}  // namespace angiospline::test
