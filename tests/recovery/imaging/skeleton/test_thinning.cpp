#include <numeric>

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "recovery/imaging/mask/topology_numbers.h"
#include "recovery/imaging/skeleton/labels.h"
#include "recovery/imaging/skeleton/thinning.h"
#include "recovery/imaging/skeleton/vessel_graph.h"
#include "tests/shapes/small_masks.h"

namespace angiospline {
namespace {

using test::empty_mask;
using test::mask_of;

std::size_t count(const Mask& mask) { return foreground_offsets(mask).size(); }

struct Variant {
  Connectivity connectivity;
  ThinningOrder order;
};
constexpr Variant kVariants[] = {{Connectivity::k26, ThinningOrder::kSubfields},
                                 {Connectivity::k26, ThinningOrder::kDistance},
                                 {Connectivity::k6, ThinningOrder::kSubfields},
                                 {Connectivity::k6, ThinningOrder::kDistance}};

Mask thinned(const Mask& mask, const Variant& v = kVariants[0]) {
  return thin(mask, {v.connectivity, v.order}).value();
}

bool is_subset(const Mask& part, const Mask& whole) {
  for (std::size_t i = 0; i < part.voxels.size(); ++i)
    if (part.voxels[i] > (whole.voxels[i] != 0 ? 1 : 0)) return false;
  return true;
}

// Boundary voxels that are neither end points nor needed by the topology.
int removable(const Mask& mask, Connectivity c) {
  int found = 0;
  for (const std::size_t i : foreground_offsets(mask)) {
    const Block block = block_around(mask, mask.grid.voxel(i));
    if (is_simple(block, c) && !is_end_point(block, c)) {
      bool boundary = false;
      for (unsigned k = 0; k < kFaceNeighbors; ++k)
        boundary = boundary || !(block & block_bit(kNeighbors[k]));
      found += boundary ? 1 : 0;
    }
  }
  return found;
}

void expect_laws(const Mask& mask, const Variant& v) {
  const Mask axis = thinned(mask, v);
  ASSERT_TRUE(is_subset(axis, mask));
  ASSERT_EQ(topology_numbers(mask, v.connectivity), topology_numbers(axis, v.connectivity));
  ASSERT_EQ(removable(axis, v.connectivity), 0);
  ASSERT_EQ(thinned(axis, v).voxels, axis.voxels) << "thinning twice must change nothing";
}

TEST(Thinning, keeps_topology_and_leaves_nothing_removable_on_thousands_of_random_masks) {
  Random random(5);
  std::int64_t cycles = 0;
  for (int i = 0; i < 1000; ++i) {
    const Voxel size{2 + random.below(14), 1 + random.below(12), 1 + random.below(12)};
    const double density = random.uniform(0.2, 0.95);
    const Mask mask = i % 2 == 0 ? test::noise_mask(size, density, random)
                                 : test::blob_mask(size, density, random);
    cycles += topology_numbers(mask).cycles;
    for (const Variant& v : kVariants) expect_laws(mask, v);
  }
  EXPECT_GT(cycles, 1000) << "the masks are too plain to prove anything";
}

TEST(Thinning, accepts_empty_full_and_single_voxel_masks) {
  for (const Variant& v : kVariants) {
    EXPECT_EQ(count(thinned(empty_mask({7, 5, 3}), v)), 0U);
    EXPECT_EQ(count(thinned(Mask{}, v)), 0U);
    const Mask full = thinned(Mask(empty_mask({9, 9, 9}).grid, 255), v);
    EXPECT_EQ(topology_numbers(full, v.connectivity), (TopologyNumbers{1, 0, 0, 1}));
    const Mask one = mask_of({1, 1, 1}, {{0, 0, 0}});
    EXPECT_EQ(thinned(one, v).voxels, one.voxels);
  }
}

TEST(Thinning, counts_any_value_but_0_as_foreground) {
  Random random(6);
  const Mask plain = test::blob_mask({20, 20, 20}, 0.6, random);
  Mask labelled = plain;
  for (auto& v : labelled.voxels)
    if (v != 0) v = static_cast<std::uint8_t>(1 + random.below(255));
  for (const Variant& v : kVariants)
    EXPECT_EQ(thinned(labelled, v).voxels, thinned(plain, v).voxels);
}

TEST(Thinning, does_not_depend_on_the_number_of_threads) {
  Mask mask = empty_mask({96, 96, 96});
  test::add_tube(mask, Vec3(20, 20, 5), Vec3(70, 75, 90), 18.0);
  test::add_tube(mask, Vec3(90, 10, 30), Vec3(10, 80, 60), 9.0);
  for (const Variant& v : kVariants) {
    Mask alone;
    {
      const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
      alone = thinned(mask, v);
    }
    const tbb::global_control many(tbb::global_control::max_allowed_parallelism, 4);
    EXPECT_EQ(thinned(mask, v).voxels, alone.voxels);
  }
}

TEST(Thinning, keeps_a_bar_of_even_width) {
  for (const Voxel& cut : {Voxel{4, 4, 100}, Voxel{5, 4, 100}, Voxel{2, 2, 100}}) {
    Mask mask = empty_mask({10, 10, 104});
    for (int z = 0; z < cut[2]; ++z)
      for (int y = 0; y < cut[1]; ++y)
        for (int x = 0; x < cut[0]; ++x) mask[{3 + x, 3 + y, 2 + z}] = 1;
    for (const Variant& v : kVariants) {
      const Mask axis = thinned(mask, v);
      EXPECT_EQ(topology_numbers(axis, v.connectivity), (TopologyNumbers{1, 0, 0, 1}));
      int low = 1000;
      int high = -1;
      for (const std::size_t i : foreground_offsets(axis)) {
        low = std::min(low, axis.grid.voxel(i)[2]);
        high = std::max(high, axis.grid.voxel(i)[2]);
      }
      EXPECT_GE(high - low, 100 - 2 * 3) << cut[0] << " " << cut[1];
    }
  }
}

TEST(Thinning, turns_a_ring_into_one_closed_curve) {
  Mask mask = empty_mask({40, 40, 12});
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) {
    const Voxel v = mask.grid.voxel(i);
    const double ring = std::hypot(v[0] - 19.3, v[1] - 20.1) - 13.0;
    mask.voxels[i] = std::hypot(ring, v[2] - 5.6) <= 3.5 ? 1 : 0;
  }
  const SkeletonLabels labels = label_skeleton(thinned(mask));
  const VesselGraph graph = vessel_graph(labels);
  EXPECT_EQ(graph.cycle_count(), 1);
  EXPECT_EQ(graph.component_count(), 1);
  EXPECT_GT(labels.voxels.size(), 60U);
}

TEST(Thinning, in_the_plane_is_the_thinning_of_the_plane) {
  Mask mask = empty_mask({60, 40, 1});
  for (int y = 10; y < 30; ++y)
    for (int x = 5; x < 55; ++x)
      if (std::hypot(x - 20, y - 19) > 5.0) mask[{x, y, 0}] = 1;  // a plate with one hole
  for (const Variant& v : kVariants) {
    const Mask axis = thinned(mask, v);
    EXPECT_EQ(topology_numbers(axis, v.connectivity).cycles, 1);
    EXPECT_EQ(removable(axis, v.connectivity), 0);
    EXPECT_LT(count(axis), 260U) << "of 921 voxels";
  }
}

TEST(Thinning, makes_the_linked_rings_a_graph_of_six_junctions_and_twelve_arcs) {
  const Mask mask = test::rings_mask(64, 22.0, 3.2);
  const VesselGraph graph = vessel_graph(label_skeleton(thinned(mask)));
  EXPECT_EQ(graph.cycle_count(), 7);
  EXPECT_EQ(topology_numbers(thinned(mask)), topology_numbers(mask));
}

TEST(Thinning, stops_when_asked_to) {
  Progress progress;
  progress.stop_requested = [] { return true; };
  const auto result = thin(test::rings_mask(32, 10.0, 3.0), {}, progress);
  ASSERT_FALSE(result.has_value());
  EXPECT_EQ(result.error().kind, ErrorKind::kCancelled);
}

TEST(Rethinning, takes_away_all_but_what_is_kept_and_the_loops) {
  Mask mask = mask_of({12, 9, 3}, {{0, 1, 1},
                                   {1, 1, 1},
                                   {2, 1, 1},
                                   {3, 2, 1},
                                   {4, 1, 1},
                                   {5, 0, 1},
                                   {3, 3, 1},
                                   {3, 4, 1},
                                   {8, 3, 1},
                                   {9, 4, 1},
                                   {8, 5, 1},
                                   {7, 4, 1}});
  const Mask before = mask;
  const std::vector<std::size_t> all = foreground_offsets(mask);
  rethin(mask, all, {mask.grid.offset({0, 1, 1}), mask.grid.offset({5, 0, 1})});
  EXPECT_EQ(mask[(Voxel{3, 4, 1})], 0) << "the twig that is not kept goes";
  EXPECT_EQ(mask[(Voxel{0, 1, 1})], 1);
  EXPECT_EQ(mask[(Voxel{5, 0, 1})], 1);
  EXPECT_EQ(topology_numbers(mask), topology_numbers(before));
  EXPECT_TRUE(is_subset(mask, before));
}

}  // namespace
}  // namespace angiospline
