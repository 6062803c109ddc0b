// Fitting files: what is refused before anything long begins, and which parts came to rest.
// tests/cli/test_fit_command.cpp fits through the program.
#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "io/images/image_file.h"
#include "pipeline/finish_model.h"
#include "pipeline/fit.h"
#include "recovery/phantoms/phantom.h"
#include "tests/cli/run_program.h"

namespace angiospline {
namespace {

class FitFile : public testing::Test {
 protected:
  void SetUp() override {
    PhantomOptions options;
    options.snr = 8;
    const auto phantom = make_phantom(PhantomKind::kPotato, options);
    ASSERT_TRUE(phantom);
    truth_ = phantom->truth;
    ASSERT_TRUE(write_image(phantom->image, image_));
    ASSERT_TRUE(write_image(truth_, mask_));
  }
  Result<FittedFile> fit(const FitFileOptions& options) const {
    return fit_file(mask_, image_, {folder_.path() / "out.json"}, options);
  }
  void expect_refusal(const FitFileOptions& options, const std::string& words) const {
    const std::vector<std::string> before = folder_.files();
    const auto fitted = fit(options);
    ASSERT_FALSE(fitted);
    EXPECT_NE(fitted.error().message().find(words), std::string::npos) << fitted.error().message();
    EXPECT_EQ(folder_.files(), before);
  }

  test::TemporaryFolder folder_;
  std::string image_ = folder_ / "image.nrrd";
  std::string mask_ = folder_ / "mask.nrrd";
  Mask truth_;
};

TEST_F(FitFile, AMaskBecomesAClosedSurfaceThatIsMeasuredByTheTruth) {
  FitFileOptions options;
  options.fit.refinements = 0;
  options.truth = mask_;
  options.residual = folder_ / "left.vtp";
  const auto fitted = fit(options);
  ASSERT_TRUE(fitted) << fitted.error().message();
  EXPECT_TRUE(is_sound(fitted->certificate));
  EXPECT_EQ(fitted->model.name, "mask");
  ASSERT_TRUE(fitted->wall && fitted->truth);
  EXPECT_FALSE(fitted->edges);
  EXPECT_GT(fitted->truth->dice, 0.9);
  EXPECT_EQ(fitted->parts.back().name, "all");
  EXPECT_EQ(fitted->wall->mean_residual_mm, fitted->parts.back().residual_mean);
  EXPECT_EQ(fitted->files, (std::vector<std::string>{folder_ / "out.json", folder_ / "left.vtp"}));
  for (const std::string& file : fitted->files) EXPECT_TRUE(std::filesystem::exists(file)) << file;
}

TEST_F(FitFile, ATruthOnAnotherGridIsRefusedBeforeTheFit) {
  Mask shifted = truth_;
  shifted.grid.origin_mm += Vec3(0.5, 0, 0);
  ASSERT_TRUE(write_image(shifted, folder_ / "shifted.nrrd"));
  FitFileOptions options;
  options.truth = folder_ / "shifted.nrrd";
  expect_refusal(options, "does not lie where the image does");

  PhantomOptions coarse;
  coarse.spacing_mm = Vec3::Constant(2);
  const auto other = make_phantom(PhantomKind::kPotato, coarse);
  ASSERT_TRUE(other);
  ASSERT_TRUE(write_image(other->truth, folder_ / "coarse.nrrd"));
  options.truth = folder_ / "coarse.nrrd";
  expect_refusal(options, "not of the image's size");
}

TEST_F(FitFile, ResidualsGoToTrianglesOnly) {
  FitFileOptions options;
  options.residual = folder_ / "left.step";
  expect_refusal(options, "left.step");
}

TEST_F(FitFile, WhatIsNoModelAndNoMaskIsRefused) {
  const std::string text = folder_.write("notes.txt", "no image");
  const auto fitted = fit_file(text, image_, {folder_.path() / "out.json"});
  ASSERT_FALSE(fitted);
  EXPECT_NE(fitted.error().message().find("only a native model or a mask"), std::string::npos);
}

TEST(ConvergedPart, IsOneThatWasNotNamedWhereTheRestCameToRest) {
  FittedFile fitted;
  fitted.converged = true;
  EXPECT_TRUE(converged_part(fitted, "wall_1"));
  fitted.converged = false;
  EXPECT_FALSE(converged_part(fitted, "wall_1"));

  // The whole did not converge because of a part: that one alone did not.
  fitted.unconverged = {"wall_2"};
  EXPECT_TRUE(converged_part(fitted, "wall_1"));
  EXPECT_FALSE(converged_part(fitted, "wall_2"));
}

}  // namespace
}  // namespace angiospline
