// From an image to a model: what floods is refused, what cannot be fitted is kept, and the file is
// read once.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

#include "io/images/image_file.h"
#include "io/model/model_file.h"
#include "pipeline/finish_model.h"
#include "pipeline/recover.h"
#include "recovery/phantoms/phantom.h"
#include "tests/cli/run_program.h"

namespace angiospline {
namespace {

namespace fs = std::filesystem;

// A bent vessel of radius 2.5 mm that leaves the image at both ends.
Image<float> vessel() {
  const auto phantom = make_phantom(PhantomKind::kBentVessel);
  EXPECT_TRUE(phantom);
  Image<float> image(phantom->image.grid);
  std::copy(phantom->image.voxels.begin(), phantom->image.voxels.end(), image.voxels.begin());
  return image;
}

bool mentions(const std::vector<Warning>& warnings, const std::string& words) {
  return std::any_of(warnings.begin(), warnings.end(), [&](const Warning& warning) {
    return warning.text.find(words) != std::string::npos;
  });
}

std::string contents(const fs::path& path) {
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

// A cube of 20 voxels with this share of it full: whole slices, or (with loops) a grid of bars.
Mask filled(double share, bool loops) {
  ImageGrid grid;
  grid.size = {20, 20, 20};
  Mask mask(grid);
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) {
    const Voxel v = grid.voxel(i);
    const int on_axis = (v[0] % 2 == 0) + (v[1] % 2 == 0) + (v[2] % 2 == 0);
    mask.voxels[i] = loops ? on_axis >= 2 : v[2] < static_cast<int>(20 * share);
  }
  return mask;
}

TEST(Flooded, IsAMaskThatFillsMuchAndHasManyLoopsOrFillsNearlyAll) {
  EXPECT_FALSE(flooded(filled(0.15, false), "image"));
  EXPECT_FALSE(flooded(filled(0.5, false), "image"));  // a large aneurysm: no loops
  EXPECT_TRUE(flooded(filled(0.95, false), "image"));
  const auto error = flooded(filled(0.5, true), "image.nrrd");  // half of it, hundreds of loops
  ASSERT_TRUE(error);
  EXPECT_EQ(error->kind, ErrorKind::kBadInput);
  EXPECT_EQ(error->where, "image.nrrd");
  EXPECT_NE(error->value.find("50 %"), std::string::npos) << error->value;
}

TEST(Recover, AFloodedImageIsRefusedAndLeavesNoFolder) {
  const test::TemporaryFolder folder;
  Image<float> image = vessel();
  std::fill(image.voxels.begin(), image.voxels.end(), 100.0F);
  image.voxels[0] = 0;
  ASSERT_TRUE(write_image(image, folder / "image.nrrd"));
  RecoverOptions options;
  options.image.seeds_vox = {Vec3(16, 16, 24)};
  options.image.segment.neighbourhood_vox = 3;
  options.image.segment.deviations = 3;
  options.image.segment.background = 50;
  options.image.segment.smoothing_vox = 0;
  const auto recovered = recover_file(folder / "image.nrrd", folder / "out", options);
  ASSERT_FALSE(recovered);
  EXPECT_NE(recovered.error().message().find("it leaks"), std::string::npos)
      << recovered.error().message();
  EXPECT_EQ(folder.files(), std::vector<std::string>{"image.nrrd"});
}

TEST(Recover, WhatCannotBeFittedKeepsTheMasksWallsWithAWarning) {
  // One voxel far from the vessel is no number: growing never looks at it, a fit refuses the image.
  Image<float> image = vessel();
  image.voxels.front() = std::numeric_limits<float>::quiet_NaN();
  RecoverOptions options;
  options.image.segment.smoothing_vox = 0;
  const AnyImage any = image;
  const auto recovered = recover_model(any, "bend", "memory", options);
  ASSERT_TRUE(recovered) << recovered.error().message();
  EXPECT_TRUE(
      mentions(recovered->model.warnings, "the walls were not fitted to the image: memory"));

  options.fit = false;
  const auto unfitted = recover_model(any, "bend", "memory", options);
  ASSERT_TRUE(unfitted);
  EXPECT_FALSE(mentions(unfitted->model.warnings, "not fitted"));
  EXPECT_EQ(recovered->model.network.control_points_mm, unfitted->model.network.control_points_mm);
}

TEST(Recover, FittingMovesTheWallsAndNamesComeFromTheCaller) {
  const AnyImage image = vessel();
  RecoverOptions options;
  const auto fitted = recover_model(image, "bend", "memory", options);
  ASSERT_TRUE(fitted) << fitted.error().message();
  EXPECT_EQ(fitted->model.name, "bend");
  EXPECT_EQ(fitted->vessels.tree.source, "memory");
  EXPECT_FALSE(mentions(fitted->model.warnings, "not fitted"));
  options.fit = false;
  const auto unfitted = recover_model(image, "bend", "memory", options);
  ASSERT_TRUE(unfitted);
  EXPECT_NE(fitted->model.network.control_points_mm, unfitted->model.network.control_points_mm);
}

TEST(Recover, TheFileIsReadOnceAndItsModelIsThatOfTheImageAndOfTheCommand) {
  const test::TemporaryFolder folder;
  const Image<float> image = vessel();
  const std::string path = folder / "bend.nrrd";
  ASSERT_TRUE(write_image(image, path));
  const test::ProgramRun run =
      test::run_angiospline({"recover", path, "-o", folder / "by_command", "--refinements", "1"});
  EXPECT_EQ(run.exit_code, 0) << run.err;

  // Once the mask is there the image goes: whoever reads it again fails.
  RecoverOptions options;
  options.fitting.refinements = 1;
  Progress progress;
  progress.report = [&](std::string_view, double) {
    if (fs::exists(folder / "by_call/mask.nrrd")) fs::remove(path);
  };
  const auto recovered = recover_file(path, folder / "by_call", options, progress);
  ASSERT_TRUE(recovered) << recovered.error().message();
  EXPECT_FALSE(fs::exists(path));
  EXPECT_TRUE(is_sound(recovered->certificate));
  for (const std::string& file : recovered->files) EXPECT_TRUE(fs::exists(file)) << file;

  for (const char* name :
       {"mask.nrrd", "skeleton.nrrd", "centerlines.swc", "model.json", "model.step", "model.stl"}) {
    EXPECT_EQ(contents(folder.path() / "by_call" / name),
              contents(folder.path() / "by_command" / name))
        << name;
  }
  const auto in_memory = recover_model(image, "bend", path, options);
  ASSERT_TRUE(in_memory);
  EXPECT_EQ(in_memory->model.network.control_points_mm, recovered->model.network.control_points_mm);
}

TEST(Recover, EndsAtOnceWhenItIsAskedToStop) {
  Progress progress;
  progress.stop_requested = [] { return true; };
  const auto recovered = recover_model(vessel(), "bend", "memory", {}, progress);
  ASSERT_FALSE(recovered);
  EXPECT_EQ(recovered.error().kind, ErrorKind::kCancelled);
}

}  // namespace
}  // namespace angiospline
