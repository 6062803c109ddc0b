// angiospline fit: a model and its image in, the fitted model and its figures out.
#include <filesystem>
#include <limits>
#include <string>
#include <variant>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/centerlines/centerline_export.h"
#include "io/centerlines/centerline_file.h"
#include "io/images/image_file.h"
#include "io/model/model_file.h"
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
  EXPECT_TRUE(json["converged"]);
  EXPECT_GT(json["iterations"], 0);
  EXPECT_LT(json["residual_force"]["mean"], 0.1);
  EXPECT_GE(json["residual_force"]["max"], json["residual_force"]["mean"]);
  EXPECT_GE(json["moved_mm"]["max"], json["moved_mm"]["mean"]);
  ASSERT_EQ(json["parts"].size(), 1U);
  for (const char* key : {"name", "iterations", "converged", "residual_force", "moved_mm"}) {
    EXPECT_TRUE(json["parts"][0].contains(key)) << key;
  }
  EXPECT_GT(json["truth_voxels"], 500);
  EXPECT_NEAR(json["missed_percent"],
              100.0 * json["missed_voxels"].get<double>() / json["truth_voxels"].get<double>(),
              1e-9);
  EXPECT_LT(json["missed_percent"], 10);  // 6.5 are its round ends, cut flat here
  EXPECT_GT(json["dice"], 0.95);
  EXPECT_LT(json["assd_mm"], 0.3);
  EXPECT_GE(json["hausdorff95_mm"], json["assd_mm"]);
  EXPECT_LT(json["check"]["max_normal_angle_deg"], 0.01);
  EXPECT_TRUE(json["check"]["valid"]);
  EXPECT_TRUE(read_model(folder_ / "out.json"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "residual.glb"));
}

TEST_F(Fit, TakesSolversAndPotentialsByName) {
  int done = 0;
  for (const char* solver : {"sparse", "euler-dft-phantom", "central", "runge-kutta-4"}) {
    const char* potential = done % 2 == 0 ? "gravity" : "spring";
    const ProgramRun run = fit({"--solver", solver, "--potential", potential, "--iterations", "10",
                                "--residual", folder_ / "force.vtp", "--json"});
    ASSERT_TRUE(run.exit_code == 0 || run.exit_code == 1) << solver << ": " << run.err;
    const auto json = nlohmann::json::parse(run.out);
    EXPECT_EQ(json["fit"]["method"], solver);
    EXPECT_EQ(json["fit"]["potential"], potential);
    EXPECT_EQ(json["residual_force"]["unit"], "potential");
    EXPECT_TRUE(json["check"]["closed"]);
    ++done;
  }
  EXPECT_EQ(done, 4);
  const ProgramRun wrong = fit({"--solver", "newton"});
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_NE(wrong.err.find("newton"), std::string::npos);
}

TEST_F(Fit, MakesAClosedSurfaceOfAMask) {
  ASSERT_EQ(run_angiospline({"phantom", "potato", "--snr", "8", "-o", folder_ / "potato.nrrd",
                             "--truth", folder_ / "potato_truth.nrrd"})
                .exit_code,
            0);
  const ProgramRun run = run_angiospline(
      {"fit", folder_ / "potato_truth.nrrd", folder_ / "potato.nrrd", "-o", folder_ / "potato.json",
       folder_ / "potato.step", "--truth", folder_ / "potato_truth.nrrd", "--json"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto json = nlohmann::json::parse(run.out);
  EXPECT_LT(json["missed_percent"], 2);
  EXPECT_EQ(json["check"]["solids"], 1);
  EXPECT_TRUE(json["check"]["valid"]);
  EXPECT_EQ(json["check"]["genus"], 0);
  EXPECT_LT(json["check"]["max_normal_angle_deg"], 0.01);
}

TEST_F(Fit, RefinesAModelAsItIsWithoutCapture) {
  const ProgramRun run = fit({"--no-capture", "--json"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(nlohmann::json::parse(run.out)["fit"]["mean_axis_move_mm"], 0.0);
}

TEST_F(Fit, RefinesAsOftenAsIsAskedFor) {
  // A model of 0.6 of the radius, so that the wall is far off where nothing is captured first.
  auto tree = read_centerline_file(folder_ / "tree.swc");
  ASSERT_TRUE(tree);
  for (CenterlineBranch& branch : tree->branches) branch.radii_mm *= 0.6;
  ASSERT_TRUE(write_centerline_file(folder_ / "thin.swc", *tree));
  const std::string thin = folder_ / "thin.json";
  ASSERT_EQ(run_angiospline({"seed", folder_ / "thin.swc", "-o", thin}).exit_code, 0);
  const auto refined = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments{
        "fit", thin, folder_ / "image.nrrd", "--no-capture", "-o", folder_ / "out.json", "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramRun run = run_angiospline(arguments);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return nlohmann::json::parse(run.out)["fit"]["refined"].size();
  };
  EXPECT_EQ(refined({}), 1U);
  EXPECT_EQ(refined({"--refinements", "0"}), 0U);
  EXPECT_EQ(fit({"--refinements", "11"}).exit_code, 2);
  EXPECT_EQ(fit({"--refinements", "1", "--solver", "sparse"}).exit_code, 2);
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
  auto shifted = read_image(folder_ / "truth.nrrd");
  ASSERT_TRUE(shifted);
  std::visit([](auto& truth) { truth.grid.origin_mm += Vec3(3, 0, 0); }, shifted->image);
  ASSERT_TRUE(std::visit(
      [&](const auto& truth) { return write_image(truth, folder_ / "off.nrrd"); }, shifted->image));
  refused({"fit", seed, image, "-o", out, "--residual", folder_ / "left.vtp", "--truth",
           folder_ / "off.nrrd"},
          "off.nrrd: the truth does not lie where the image does");
  refused({"fit", seed, image, "-o", out, "--dark"}, "the vessel is not darker");
  refused({"fit", folder_ / "tree.swc", image, "-o", out},
          "only a native model or a mask can be fitted");
  refused({"fit", seed, image, "-o", out, "--solver", "sparse", "--strength", "0"}, "strength");
  refused({"fit", seed, image, "-o", out, "--solver", "sparse", "--stiffness", "-1"}, "spring");
  refused({"fit", seed, image, "-o", out, "--potential", "gravity"}, "--solver");
  refused({"fit", seed, image, "-o", out, "--residual", folder_ / "r.stl"}, ".glb or .vtp");
  EXPECT_FALSE(std::filesystem::exists(out));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "left.vtp"));
}

}  // namespace
}  // namespace angiospline::test
