// Image files to masks: seeds in both units, errors with the file's name, masks as they are.
#include <string>
#include <variant>

#include <gtest/gtest.h>

#include "io/images/image_file.h"
#include "pipeline/segment_file.h"
#include "recovery/phantoms/phantom.h"
#include "tests/cli/run_program.h"

namespace angiospline {
namespace {

class SegmentFile : public testing::Test {
 protected:
  void SetUp() override {
    PhantomOptions options;
    options.spacing_mm = Vec3(1, 1, 1.25);
    options.origin_mm = Vec3(10, -20, 30);
    auto made = make_phantom(PhantomKind::kBentVessel, options);
    ASSERT_TRUE(made);
    phantom_ = *std::move(made);
    ASSERT_TRUE(write_image(phantom_.image, path_));
    // The voxel of the vessel nearest to the middle of the image.
    const ImageGrid& grid = phantom_.truth.grid;
    double best = 1e9;
    for (std::size_t i = 0; i < phantom_.truth.voxels.size(); ++i) {
      if (phantom_.truth.voxels[i] == 0) continue;
      const Voxel v = grid.voxel(i);
      const Vec3 at(v[0], v[1], v[2]);
      const Vec3 middle(0.5 * grid.size[0], 0.5 * grid.size[1], 0.5 * grid.size[2]);
      if ((at - middle).norm() < best) best = (at - middle).norm(), seed_vox_ = at;
    }
  }

  test::TemporaryFolder folder_;
  std::string path_ = folder_ / "image.nrrd";
  Phantom phantom_;
  Vec3 seed_vox_;
};

TEST_F(SegmentFile, ASeedInVoxelsIsTheSameOneInMillimetres) {
  SegmentFileOptions in_voxels;
  in_voxels.seeds_vox = {seed_vox_};
  SegmentFileOptions in_mm;
  in_mm.segment.seeds_mm = {phantom_.image.grid.world_mm(seed_vox_)};
  Stopwatch watch;
  const auto a = segment_file(path_, in_voxels, {}, watch);
  const auto b = segment_file(path_, in_mm, {}, watch);
  ASSERT_TRUE(a && b);
  EXPECT_GT(a->segmented.report.grown.voxels, 500U);
  EXPECT_EQ(a->segmented.mask.voxels, b->segmented.mask.voxels);
  EXPECT_EQ(a->segmented.report.seeds_found, false);
}

TEST_F(SegmentFile, TheImageComesBackAsItWasRead) {
  SegmentFileOptions options;
  options.seeds_vox = {seed_vox_};
  Stopwatch watch;
  const auto file = segment_file(path_, options, {}, watch);
  ASSERT_TRUE(file);
  const auto* image = std::get_if<Image<std::int16_t>>(&file->image);
  ASSERT_NE(image, nullptr);
  EXPECT_EQ(image->voxels, phantom_.image.voxels);
  ASSERT_EQ(watch.laps().size(), 2U);
  EXPECT_EQ(watch.laps()[0].first, "read");
}

TEST_F(SegmentFile, TheMaskThatIsWrittenIsTheOneThatGrew) {
  SegmentFileOptions options;
  options.seeds_vox = {seed_vox_};
  const auto written = segment_to_file(path_, folder_ / "mask.nrrd", options);
  ASSERT_TRUE(written) << written.error().message();
  const auto mask = read_mask(folder_ / "mask.nrrd");
  ASSERT_TRUE(mask);
  Stopwatch watch;
  const auto again = segment_file(path_, options, {}, watch);
  ASSERT_TRUE(again);
  EXPECT_EQ(mask->voxels, again->segmented.mask.voxels);
}

TEST_F(SegmentFile, ErrorsNameTheFile) {
  SegmentFileOptions outside;
  outside.segment.seeds_mm = {Vec3(5000, 0, 0)};
  const auto segmented = segment_to_file(path_, folder_ / "mask.nrrd", outside);
  ASSERT_FALSE(segmented);
  EXPECT_EQ(segmented.error().where.find(path_), 0U) << segmented.error().where;

  Mask empty(phantom_.truth.grid);
  ASSERT_TRUE(write_image(empty, folder_ / "empty.nrrd"));
  const auto mask = read_mask(folder_ / "empty.nrrd");
  ASSERT_FALSE(mask);
  EXPECT_EQ(mask.error().where, folder_ / "empty.nrrd");
  EXPECT_FALSE(read_level_set(folder_ / "empty.nrrd"));
}

TEST_F(SegmentFile, ViewsNeedASeedAndABackgroundBeforeAnythingIsRead) {
  MultimodalFileOptions options;
  options.views = folder_ / "missing.json";
  options.image.seeds_vox = {seed_vox_};
  for (const bool background : {false, true}) {
    if (background) options.image.segment.background = 400;
    const auto grown = segment_with_views(path_, folder_ / "mask.nrrd", options);
    ASSERT_FALSE(grown);
    const bool refused = grown.error().what.find("needs more") != std::string::npos;
    EXPECT_EQ(refused, !background) << grown.error().message();
  }
}

}  // namespace
}  // namespace angiospline
