#include <limits>

#include <gtest/gtest.h>

#include "recovery/imaging/mask/distance_transform.h"
#include "recovery/imaging/skeleton/thinning.h"
#include "tests/shapes/small_masks.h"

namespace angiospline {
namespace {

double by_brute_force(const Mask& mask, const Voxel& v, bool to_boundary) {
  double least = std::numeric_limits<double>::infinity();
  double answer = 0.0;
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) {
    if (mask.voxels[i] != 0) continue;
    const Voxel u = mask.grid.voxel(i);
    const Vec3 steps(u[0] - v[0], u[1] - v[1], u[2] - v[2]);
    const double d = steps.cwiseProduct(mask.grid.spacing_mm).norm();
    if (d >= least) continue;
    least = d;
    answer = to_boundary ? d * (1.0 - 0.5 / steps.norm()) : d;
  }
  return answer;
}

TEST(DistanceTransform, agrees_with_brute_force_for_any_spacing) {
  Random random(13);
  for (int i = 0; i < 40; ++i) {
    Mask mask = test::blob_mask({1 + random.below(20), 1 + random.below(12), 1 + random.below(12)},
                                0.75, random);
    mask.grid.spacing_mm =
        Vec3(random.uniform(0.2, 3.0), random.uniform(0.2, 3.0), random.uniform(0.2, 3.0));
    mask.voxels[0] = 0;
    const Image<float> distances = ForegroundDistances(mask).image();
    for (std::size_t k = 0; k < mask.voxels.size(); ++k)
      ASSERT_NEAR(distances.voxels[k],
                  mask.voxels[k] ? by_brute_force(mask, mask.grid.voxel(k), false) : 0.0, 1e-5);
  }
}

TEST(BoundaryDistances, agree_with_brute_force_in_any_order_of_places) {
  Random random(14);
  for (int i = 0; i < 20; ++i) {
    Mask mask = test::blob_mask({18, 14, 12}, 0.7, random);
    mask.grid.spacing_mm = Vec3(0.5, 0.7, 1.9);
    mask.voxels[0] = 0;
    std::vector<std::size_t> places = foreground_offsets(mask);
    for (std::size_t k = places.size(); k > 1; --k)
      std::swap(places[k - 1], places[static_cast<std::size_t>(random.below(static_cast<int>(k)))]);
    const std::vector<double> distances = boundary_distances_mm(mask, places);
    for (std::size_t k = 0; k < places.size(); ++k) {
      // Of several nearest background voxels any may give the half voxel.
      const double centre = by_brute_force(mask, mask.grid.voxel(places[k]), false);
      EXPECT_LT(distances[k], centre);
      EXPECT_GE(distances[k], centre - 0.5 * 1.9 - 1e-9);
    }
  }
}

TEST(BoundaryDistances, lie_half_a_voxel_before_a_flat_wall) {
  Mask mask = test::empty_mask({21, 5, 5}, Vec3(2, 100, 100));
  for (int x = 5; x <= 15; ++x)
    for (int y = 0; y < 5; ++y)
      for (int z = 0; z < 5; ++z) mask[{x, y, z}] = 1;
  EXPECT_NEAR(boundary_distances_mm(mask, {mask.grid.offset({10, 2, 2})})[0], 11.0, 1e-12);
}

TEST(Distances, of_an_image_without_background_go_to_the_outside) {
  Mask mask(test::empty_mask({7, 5, 9}, Vec3(1, 2, 3)).grid, 1);
  EXPECT_FLOAT_EQ((ForegroundDistances(mask).image()[{3, 2, 4}]), 4.0F);
  EXPECT_DOUBLE_EQ(boundary_distances_mm(mask, {mask.grid.offset({3, 2, 4})})[0], 3.5);
}

}  // namespace
}  // namespace angiospline
