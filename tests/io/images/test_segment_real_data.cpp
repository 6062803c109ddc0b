#include <cstdlib>
#include <filesystem>

#include <gtest/gtest.h>

#include "io/images/image_file.h"
#include "recovery/analysis/compare_masks.h"
#include "recovery/imaging/segment/segment.h"

namespace angiospline {
namespace {

namespace fs = std::filesystem;

std::optional<fs::path> data_folder() {
  const char* data = std::getenv("ANGIOSPLINE_DATA");
  if (data == nullptr) return std::nullopt;
  return fs::path(data);
}

// Inside the reference level set is negative; only its bounding box was segmented by its makers.
Mask reference_of(const Image<float>& level_set, Mask& result) {
  Mask truth(level_set.grid);
  Voxel low = truth.grid.size, high{0, 0, 0};
  for (std::size_t i = 0; i < truth.voxels.size(); ++i) {
    if (!(level_set.voxels[i] < 0)) continue;
    truth.voxels[i] = 1;
    const Voxel v = truth.grid.voxel(i);
    for (std::size_t k = 0; k < 3; ++k)
      low[k] = std::min(low[k], v[k]), high[k] = std::max(high[k], v[k]);
  }
  for (std::size_t i = 0; i < truth.voxels.size(); ++i) {
    const Voxel v = truth.grid.voxel(i);
    for (std::size_t k = 0; k < 3; ++k)
      if (v[k] < low[k] || v[k] > high[k]) result.voxels[i] = 0;
  }
  return truth;
}

TEST(SegmentRealData, FindsTheAortaWithoutAnyParameter_real_data) {
  const auto data = data_folder();
  if (!data) GTEST_SKIP() << "ANGIOSPLINE_DATA is not set";
  auto image = read_image(*data / "volumes" / "vmtk_aorta.mha");
  const auto level_set = read_image(*data / "surfaces" / "aorta-final-levelset.mha");
  ASSERT_TRUE(image && level_set);
  auto s = segment(std::move(image->image));
  ASSERT_TRUE(s.has_value()) << s.error().message();
  EXPECT_TRUE(s->report.seeds_found);
  EXPECT_TRUE(s->report.warnings.empty());
  EXPECT_EQ(topology_numbers(s->mask), (TopologyNumbers{1, 0, 0, 1}));
  const Voxel size = s->mask.grid.size;  // the aorta fades towards the border and goes on to it
  bool reaches_border = false;
  for (int x = 0; x < size[0]; ++x)
    for (int z = 0; z < size[2]; ++z) reaches_border |= s->mask[{x, size[1] - 1, z}] != 0;
  EXPECT_TRUE(reaches_border);
  s->mask.grid = grid_of(level_set->image);  // the same voxels; the files differ in orientation
  const Mask truth = reference_of(std::get<Image<float>>(level_set->image), s->mask);
  const auto c = compare_masks(truth, s->mask);
  ASSERT_TRUE(c.has_value()) << c.error().message();
  EXPECT_GT(c->dice, 0.91);
  EXPECT_LT(c->missed, 100U);
  EXPECT_LT(c->surface->mean_mm, 0.8);
}

TEST(SegmentRealData, FindsTheCircleOfWillisWithoutAnyParameter_real_data) {
  const auto data = data_folder();
  if (!data) GTEST_SKIP() << "ANGIOSPLINE_DATA is not set";
  auto image = read_image(*data / "volumes" / "chris_MRA.nii.gz");
  ASSERT_TRUE(image.has_value());
  const auto s = segment(std::move(image->image));
  ASSERT_TRUE(s.has_value()) << s.error().message();
  EXPECT_TRUE(s->report.warnings.empty());
  const TopologyNumbers t = topology_numbers(s->mask);
  EXPECT_LE(t.components, 2);  // the communicating arteries at the back are at the limit
  EXPECT_EQ(t.cavities, 0);
  // The circle is open for the same reason. Tunnels a voxel or two wide, in the siphon and where
  // branches of the middle cerebral artery touch, are filled.
  EXPECT_EQ(t.cycles, 0);
  // Carotids, basilar artery, both middle cerebral arteries: voxels read off the image.
  for (const Voxel& v :
       {Voxel{40, 120, 8}, Voxel{92, 128, 20}, Voxel{30, 181, 55}, Voxel{160, 181, 52}}) {
    bool near = false;
    for (int z = -4; z <= 4; ++z)
      for (int y = -4; y <= 4; ++y)
        for (int x = -4; x <= 4; ++x) near |= s->mask[{v[0] + x, v[1] + y, v[2] + z}] != 0;
    EXPECT_TRUE(near) << v[0] << " " << v[1] << " " << v[2];
  }
}

}  // namespace
}  // namespace angiospline
