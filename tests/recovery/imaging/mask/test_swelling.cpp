// Swellings of known size behind known necks, and the walk over foreground against a plain one.
#include <algorithm>

#include <gtest/gtest.h>

#include "recovery/imaging/mask/foreground.h"
#include "recovery/imaging/mask/swelling.h"
#include "tests/shapes/small_masks.h"

namespace angiospline {
namespace {

// A tube of radius 2 along x up to x = 30, and a ball of this radius about (40, 20, 20).
struct TubeAndBall {
  Mask all = test::empty_mask({60, 41, 41});
  Mask tube = all;

  explicit TubeAndBall(double radius) {
    for (std::size_t i = 0; i < all.voxels.size(); ++i) {
      const Voxel v = all.grid.voxel(i);
      const Vec3 p(v[0], v[1], v[2]);
      const bool in_tube = v[0] <= 30 && (p - Vec3(v[0], 20, 20)).norm() <= 2;
      tube.voxels[i] = in_tube;
      all.voxels[i] = in_tube || (p - Vec3(40, 20, 20)).norm() <= radius;
    }
  }
};

TEST(FindSwelling, PartsABallFromTheTubeThatLeadsIntoIt) {
  const TubeAndBall shape(12);
  const auto parts = find_swelling(shape.all, shape.tube);
  ASSERT_TRUE(parts);
  EXPECT_GT(parts->swelling.beyond_depth_mm, 2.5 * parts->swelling.vessel_depth_mm);
  EXPECT_NEAR(parts->swelling.beyond_depth_mm, 12, 1.5);
  EXPECT_GE(parts->swelling.neck[0], 28);
  EXPECT_LE(parts->swelling.neck[0], 36);
  std::size_t kept = 0, total = 0;
  for (std::size_t i = 0; i < shape.all.voxels.size(); ++i) {
    EXPECT_LE(parts->vessel.voxels[i], shape.all.voxels[i]);
    kept += parts->vessel.voxels[i] != 0;
    total += shape.all.voxels[i] != 0;
  }
  EXPECT_EQ(total - kept, parts->swelling.voxels);
  EXPECT_LT(kept, total / 4);
  EXPECT_FALSE(parts->swelling.cut);
}

TEST(FindSwelling, AWiderVesselBehindANeckIsNone) {
  EXPECT_FALSE(find_swelling(TubeAndBall(4).all, TubeAndBall(4).tube));
}

TEST(FindSwelling, WithoutAVesselBeforeThereIsNothingToPart) {
  const TubeAndBall shape(12);
  EXPECT_FALSE(find_swelling(shape.all, Mask(shape.all.grid)));
}

TEST(Foreground, OffsetsAndExtentsAreThoseOfAPlainPass) {
  Random random(1);
  for (const double density : {0.0, 0.01, 0.3, 1.0}) {
    const Mask mask = test::noise_mask({29, 6, 5}, density, random);
    std::vector<std::size_t> offsets;
    std::vector<RowExtent> extents(30);
    for (std::size_t i = 0; i < mask.voxels.size(); ++i) {
      if (mask.voxels[i] == 0) continue;
      offsets.push_back(i);
      RowExtent& row = extents[i / 29];
      if (row.empty()) row.begin = static_cast<int>(i % 29);
      row.end = static_cast<int>(i % 29) + 1;
    }
    EXPECT_EQ(foreground_offsets(mask), offsets);
    const std::vector<RowExtent> found = row_extents(mask);
    ASSERT_EQ(found.size(), extents.size());
    for (std::size_t r = 0; r < extents.size(); ++r) {
      EXPECT_EQ(found[r].begin, extents[r].begin);
      EXPECT_EQ(found[r].end, extents[r].end);
    }
  }
}

TEST(Foreground, TheNextOneIsFoundFromAnyPlace) {
  Random random(2);
  std::vector<std::uint8_t> values(100);
  for (auto& v : values) v = random.below(12) == 0 ? 1 : 0;
  for (std::size_t from = 0; from <= values.size(); ++from) {
    std::size_t plain = from;
    while (plain < values.size() && values[plain] == 0) ++plain;
    EXPECT_EQ(next_foreground(values.data(), from, values.size()), plain);
  }
}

}  // namespace
}  // namespace angiospline
