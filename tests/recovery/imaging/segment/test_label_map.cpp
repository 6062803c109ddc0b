// What is inside a mask, a label map or a level set, whatever its pixel type.
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "recovery/imaging/image/any_image.h"
#include "recovery/imaging/segment/label_map.h"

namespace angiospline {
namespace {

template <typename T>
Image<T> row_of(const std::vector<T>& values) {
  ImageGrid grid;
  grid.size = {static_cast<int>(values.size()), 1, 1};
  grid.spacing_mm = Vec3(0.5, 1, 2);
  grid.origin_mm = Vec3(3, 2, 1);
  Image<T> image(grid);
  image.voxels = values;
  return image;
}

std::vector<int> inside(const Mask& mask) { return {mask.voxels.begin(), mask.voxels.end()}; }

TEST(LabelMap, AllLabelsTogetherAreTheMaskOnTheSameGrid) {
  const auto image = row_of<std::int16_t>({0, 1, -3, 200, 0});
  const auto mask = mask_from_image(image, "labels.nrrd");
  ASSERT_TRUE(mask);
  EXPECT_EQ(inside(*mask), (std::vector<int>{0, 1, 1, 1, 0}));
  EXPECT_EQ(mask->grid.size, image.grid.size);
  EXPECT_EQ(mask->grid.spacing_mm, image.grid.spacing_mm);
  EXPECT_EQ(mask->grid.origin_mm, image.grid.origin_mm);
}

TEST(LabelMap, VoxelsThatAreNoNumbersAreOutside) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const auto image = row_of<float>({kNan, kInfinity, -kInfinity, 1e-30F, 0, -0.0F});
  const auto mask = mask_from_image(image, "mask.nrrd");
  ASSERT_TRUE(mask);
  EXPECT_EQ(inside(*mask), (std::vector<int>{0, 0, 0, 1, 0, 0}));
}

TEST(LabelMap, ALevelSetIsNegativeInsideAndItsZeroIsOutside) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  const auto mask = mask_from_level_set(row_of<float>({-2, -1e-30F, 0, 1, kNan}), "level.nrrd");
  ASSERT_TRUE(mask);
  EXPECT_EQ(inside(*mask), (std::vector<int>{1, 1, 0, 0, 0}));
}

TEST(AnyImage, KnowsItsPixelTypeItsGridAndItsValues) {
  const auto image = row_of<std::uint16_t>({0, 65535});
  const AnyImage any = image;
  EXPECT_EQ(pixel_type_name(any), "uint16");
  EXPECT_EQ(grid_of(any).origin_mm, image.grid.origin_mm);
  EXPECT_EQ(value_at(any, {1, 0, 0}), 65535.0);
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_TRUE(std::isnan(value_at(AnyImage(row_of<float>({kNan})), {0, 0, 0})));
}

TEST(LabelMap, AnEmptyOneIsRefusedByTheNameOfItsFile) {
  const auto none = mask_from_image(row_of<std::uint8_t>({0, 0}), "none.nrrd");
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().kind, ErrorKind::kBadInput);
  EXPECT_EQ(none.error().where, "none.nrrd");
  const auto positive = mask_from_level_set(row_of<float>({0, 1}), "outside.nrrd");
  ASSERT_FALSE(positive);
  EXPECT_EQ(positive.error().where, "outside.nrrd");
}

}  // namespace
}  // namespace angiospline
