// Images of every pixel type.
#include <cmath>
#include <limits>
#include <type_traits>
#include <vector>

#include <gtest/gtest.h>

#include "base/random.h"
#include "recovery/imaging/image/any_image.h"
#include "recovery/imaging/image/gaussian.h"
#include "recovery/imaging/image/pixel_types.h"

namespace angiospline {
namespace {

std::vector<AnyImage> images_of_every_type(const ImageGrid& grid) {
  std::vector<AnyImage> all;
#define ANGIOSPLINE_ADD(T) all.push_back(Image<T>(grid, T{7}));
  ANGIOSPLINE_FOR_PIXEL_TYPES(ANGIOSPLINE_ADD)
#undef ANGIOSPLINE_ADD
  return all;
}

TEST(AnyImage, HasTheListedPixelTypesInOrderAndKnowsTheirNames) {
  ImageGrid grid;
  grid.size = {2, 3, 4};
  const std::vector<AnyImage> all = images_of_every_type(grid);
  ASSERT_EQ(all.size(), std::variant_size_v<AnyImage>);
  const char* names[] = {"uint8", "int8", "uint16", "int16", "uint32", "int32", "float", "double"};
  for (std::size_t k = 0; k < all.size(); ++k) {
    EXPECT_EQ(all[k].index(), k);
    EXPECT_EQ(pixel_type_name(all[k]), names[k]);
    EXPECT_EQ(grid_of(all[k]).size, grid.size);
    EXPECT_EQ(value_at(all[k], {1, 2, 3}), 7);
  }
}

TEST(AnyImage, AConstantOneOfAnyTypeIsItselfWhenSmoothed) {
  ImageGrid grid;
  grid.size = {9, 8, 7};
  for (const AnyImage& image : images_of_every_type(grid)) {
    const AnyImage smooth = smoothed(image, 1.2);
    EXPECT_EQ(smooth.index(), image.index());
    for (const Voxel v : {Voxel{0, 0, 0}, Voxel{4, 4, 3}, Voxel{8, 7, 6}})
      EXPECT_NEAR(value_at(smooth, v), 7, 1e-5);
  }
}

TEST(SmoothedBox, IsThatPartOfTheSmoothedImage) {
  Random random(1);
  ImageGrid grid;
  grid.size = {14, 12, 13};
  grid.spacing_mm = Vec3(0.7, 1, 1.3);
  Image<float> image(grid);
  for (float& v : image.voxels) v = static_cast<float>(random.gaussian());
  for (const bool with_holes : {false, true}) {
    if (with_holes) {
      image[{5, 5, 5}] = std::numeric_limits<float>::quiet_NaN();
      image[{0, 3, 2}] = std::numeric_limits<float>::infinity();
    }
    for (const double sigma_mm : {0.0, 0.9}) {
      const Image<float> whole = smoothed(Image<float>(image), sigma_mm);
      const Voxel low{0, 2, 1}, high{13, 6, 12};
      const Image<float> box = smoothed_box(image, low, high, sigma_mm);
      ASSERT_EQ(box.grid.size, (Voxel{14, 5, 12}));
      EXPECT_EQ(box.grid.world_mm(Voxel{0, 0, 0}), grid.world_mm(low));
      for (std::size_t i = 0; i < box.voxels.size(); ++i) {
        const Voxel v = box.grid.voxel(i);
        const float expected = whole[{low[0] + v[0], low[1] + v[1], low[2] + v[2]}];
        if (std::isnan(expected))
          EXPECT_TRUE(std::isnan(box.voxels[i]));
        else if (std::isfinite(expected) && with_holes)  // other sums: equal but for rounding
          EXPECT_NEAR(box.voxels[i], expected, 1e-5);
        else
          EXPECT_EQ(box.voxels[i], expected);
      }
    }
  }
}

}  // namespace
}  // namespace angiospline
