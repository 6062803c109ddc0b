#include <gtest/gtest.h>

#include "recovery/imaging/mask/morphology.h"
#include "recovery/imaging/mask/topology_numbers.h"
#include "recovery/imaging/mask/tunnels.h"
#include "tests/shapes/small_masks.h"

namespace angiospline {
namespace {

using test::add_tube;
using test::empty_mask;

ClosedTunnels closed(const Mask& mask) { return close_tunnels(mask).value(); }

// Takes the voxels within `radius` of the segment away.
void drill(Mask& mask, const Vec3& a, const Vec3& b, double radius) {
  Mask hole(mask.grid);
  add_tube(hole, a, b, radius);
  for (std::size_t i = 0; i < mask.voxels.size(); ++i)
    if (hole.voxels[i] != 0) mask.voxels[i] = 0;
}

TEST(CloseTunnels, FillsAHoleThroughAVesselAndNothingElse) {
  Mask mask = empty_mask({40, 40, 60});
  add_tube(mask, Vec3(20, 20, 10), Vec3(20, 20, 50), 6);
  const Mask whole = mask;
  drill(mask, Vec3(5, 20, 30), Vec3(35, 20, 30), 1.2);
  ASSERT_EQ(topology_numbers(mask).cycles, 1);
  const ClosedTunnels c = closed(mask);
  EXPECT_EQ(c.tunnels, 1U);
  EXPECT_EQ(topology_numbers(c.mask).cycles, 0);
  EXPECT_EQ(c.voxels, voxel_count(c.mask) - voxel_count(mask));
  for (std::size_t i = 0; i < mask.voxels.size(); ++i)
    EXPECT_LE(c.mask.voxels[i], whole.voxels[i]);  // only what was drilled
}

TEST(CloseTunnels, ClosesAWiderHoleInAWiderVesselOnly) {
  for (const auto& [radius, tunnels] : {std::pair(12.0, 1U), std::pair(4.0, 0U)}) {
    Mask mask = empty_mask({44, 44, 60});
    // Half way round the hole is as thick as the vessel is beside it.
    add_tube(mask, Vec3(22, 22, 16), Vec3(22, 22, 44), radius);
    drill(mask, Vec3(0, 22, 30), Vec3(43, 22, 30), 2.3);
    ASSERT_EQ(topology_numbers(mask).cycles, 1);
    EXPECT_EQ(closed(mask).tunnels, tunnels) << radius;
  }
}

TEST(CloseTunnels, KeepsLoopsOfVessels) {
  Mask rings = test::rings_mask(64, 20, 3.2);
  const ClosedTunnels c = closed(rings);
  EXPECT_GT(topology_numbers(rings).cycles, 3);
  EXPECT_EQ(c.mask.voxels, rings.voxels);
  // Two thin vessels four voxels apart, joined at both ends.
  Mask ladder = empty_mask({40, 20, 20});
  add_tube(ladder, Vec3(5, 6, 10), Vec3(34, 6, 10), 2);
  add_tube(ladder, Vec3(5, 14, 10), Vec3(34, 14, 10), 2);
  add_tube(ladder, Vec3(5, 6, 10), Vec3(5, 14, 10), 2);
  add_tube(ladder, Vec3(34, 6, 10), Vec3(34, 14, 10), 2);
  ASSERT_EQ(topology_numbers(ladder).cycles, 1);
  EXPECT_EQ(closed(ladder).mask.voxels, ladder.voxels);
}

TEST(CloseTunnels, OnlyTakesLoopsAwayFromRandomMasks) {
  Random random(5);
  std::size_t tunnels = 0;
  for (int i = 0; i < 40; ++i) {
    const Mask mask = fill_cavities(test::blob_mask({20, 20, 20}, 0.5, random)).mask;
    const TopologyNumbers before = topology_numbers(mask);
    const ClosedTunnels c = closed(mask);
    const TopologyNumbers after = topology_numbers(c.mask);
    EXPECT_EQ(after.cavities, 0);
    EXPECT_LE(after.cycles, before.cycles);
    EXPECT_LE(after.components, before.components);
    EXPECT_EQ(before.cycles - after.cycles, static_cast<std::int64_t>(c.tunnels));
    for (std::size_t k = 0; k < mask.voxels.size(); ++k)
      EXPECT_GE(c.mask.voxels[k], mask.voxels[k]);
    tunnels += c.tunnels;
  }
  EXPECT_GT(tunnels, 100U);
}

TEST(CloseTunnels, GiveEmptyFullAndSingleVoxelMasksBack) {
  const Mask empty = empty_mask({5, 6, 7});
  EXPECT_EQ(closed(empty).mask.voxels, empty.voxels);
  Mask full = empty;
  std::fill(full.voxels.begin(), full.voxels.end(), std::uint8_t{1});
  EXPECT_EQ(closed(full).mask.voxels, full.voxels);
  EXPECT_EQ(closed(test::mask_of({3, 3, 3}, {{1, 1, 1}})).voxels, 0U);
}

}  // namespace
}  // namespace angiospline
