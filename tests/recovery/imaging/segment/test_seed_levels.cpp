// Grey values around seeds in images whose levels are known.
#include <cmath>

#include <gtest/gtest.h>

#include "base/random.h"
#include "recovery/imaging/segment/rules.h"
#include "recovery/imaging/segment/seed_levels.h"

namespace angiospline::segmentation {
namespace {

// A straight vessel along z through (20, 20), noise of deviation 3.
Image<float> tube(double radius_vox, float vessel, float background, std::uint64_t seed) {
  ImageGrid grid;
  grid.size = {41, 41, 41};
  grid.spacing_mm = Vec3::Constant(0.5);
  Image<float> image(grid, background);
  Random random(seed);
  for (std::size_t i = 0; i < image.voxels.size(); ++i) {
    const Voxel v = grid.voxel(i);
    if (std::hypot(v[0] - 20, v[1] - 20) <= radius_vox) image.voxels[i] = vessel;
    image.voxels[i] += static_cast<float>(3 * random.gaussian());
  }
  return image;
}

TEST(SeedLevels, OfAStraightVesselAreItsLevelsAndItsRadius) {
  for (const double radius_vox : {3.0, 5.0}) {
    const auto levels = levels_at(tube(radius_vox, 200, 50, 1), {20, 20, 20}, 1, 0);
    ASSERT_TRUE(levels);
    EXPECT_NEAR(levels->vessel, 200, 3);
    EXPECT_NEAR(levels->background, 50, 3);
    EXPECT_NEAR(levels->background_deviation, 3, 1);
    EXPECT_NEAR(levels->radius_mm, 0.5 * radius_vox, 0.15 * radius_vox);
  }
}

TEST(SeedLevels, AVesselThatFillsTheSmallestCubeIsSeenInALargerOne) {
  const auto levels = levels_at(tube(2 * kSmallestCube, 200, 50, 3), {20, 20, 20}, 1, 0);
  ASSERT_TRUE(levels);
  EXPECT_NEAR(levels->vessel, 200, 3);
  EXPECT_NEAR(levels->background, 50, 3);
}

TEST(SeedLevels, AnImageWithoutBackgroundHasNone) {
  ImageGrid grid;
  grid.size = {30, 30, 30};
  EXPECT_FALSE(levels_at(Image<float>(grid, 100.0F), {15, 15, 15}, 1, 0));
}

TEST(SeedLevels, OfADarkVesselAreThoseOfTheNegative) {
  const auto bright = levels_at(tube(4, -50, -200, 2), {20, 20, 20}, 1, 0);
  Image<float> negative = tube(4, -50, -200, 2);
  for (float& v : negative.voxels) v = -v;
  const auto dark = levels_at(negative, {20, 20, 20}, -1, 0);
  ASSERT_TRUE(bright && dark);
  EXPECT_EQ(bright->vessel, dark->vessel);
  EXPECT_EQ(bright->background, dark->background);
}

TEST(SeedLevels, TheMedianIsTakenOfEachFigure) {
  SeedLevels a, b, c;
  a.vessel = 1;
  b.vessel = 5;
  c.vessel = 3;
  a.radius_mm = 9;
  b.radius_mm = 7;
  c.radius_mm = 8;
  const SeedLevels m = median_of({a, b, c});
  EXPECT_EQ(m.vessel, 3);
  EXPECT_EQ(m.radius_mm, 8);
}

TEST(BrightestNear, IsTheBrightestWithinReachAndOfEqualOnesTheMiddle) {
  ImageGrid grid;
  grid.size = {9, 9, 9};
  Image<float> image(grid, 1.0F);
  EXPECT_EQ(brightest_near(image, {4, 4, 4}, 2, 1, 0).at, (Voxel{4, 4, 4}));
  image[{6, 4, 4}] = 5;
  image[{8, 4, 4}] = 9;  // too far
  const BrightVoxel found = brightest_near(image, {4, 4, 4}, 2, 1, 0);
  EXPECT_EQ(found.at, (Voxel{6, 4, 4}));
  EXPECT_EQ(found.grey, 5);
  EXPECT_EQ(brightest_near(image, {4, 4, 4}, 2, -1, 0).grey, -1);
}

TEST(VoxelAt, IsTheNearestOneAlsoOutside) {
  ImageGrid grid;
  grid.size = {4, 4, 4};
  grid.spacing_mm = Vec3(1, 2, 3);
  grid.origin_mm = Vec3(10, 0, 0);
  EXPECT_EQ(voxel_at(grid, Vec3(11.4, 2.2, 5.9)), (Voxel{1, 1, 2}));
  EXPECT_EQ(voxel_at(grid, Vec3(8, 0, 0)), (Voxel{-2, 0, 0}));
}

}  // namespace
}  // namespace angiospline::segmentation
