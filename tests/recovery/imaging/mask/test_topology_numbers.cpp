#include <gtest/gtest.h>

#include "recovery/imaging/mask/topology_numbers.h"
#include "tests/shapes/small_masks.h"

namespace angiospline {
namespace {

using test::empty_mask;
using test::mask_of;

// Pieces by flood fill in a padded copy, and the Euler characteristic by counting cells one by one.
TopologyNumbers by_brute_force(const Mask& mask, Connectivity connectivity) {
  Voxel n = mask.grid.size;
  Mask padded = empty_mask({n[0] + 2, n[1] + 2, n[2] + 2});
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) {
    const Voxel v = mask.grid.voxel(i);
    padded[{v[0] + 1, v[1] + 1, v[2] + 1}] = mask.voxels[i] != 0;
  }
  const auto pieces = [&](std::uint8_t value, Connectivity c) {
    std::vector<bool> seen(padded.voxels.size(), false);
    int count = 0;
    for (std::size_t i = 0; i < padded.voxels.size(); ++i) {
      if (padded.voxels[i] != value || seen[i]) continue;
      ++count;
      std::vector<std::size_t> stack{i};
      seen[i] = true;
      while (!stack.empty()) {
        const Voxel v = padded.grid.voxel(stack.back());
        stack.pop_back();
        for (unsigned k = 0; k < static_cast<unsigned>(neighbor_count(c)); ++k) {
          const Voxel u{v[0] + kNeighbors[k][0], v[1] + kNeighbors[k][1], v[2] + kNeighbors[k][2]};
          if (!padded.grid.contains(u)) continue;
          const std::size_t o = padded.grid.offset(u);
          if (padded.voxels[o] != value || seen[o]) continue;
          seen[o] = true;
          stack.push_back(o);
        }
      }
    }
    return count;
  };
  const bool is26 = connectivity == Connectivity::k26;
  TopologyNumbers t;
  t.components = pieces(1, connectivity);
  t.cavities = pieces(0, is26 ? Connectivity::k6 : Connectivity::k26) - 1;
  n = padded.grid.size;
  const auto at = [&](int x, int y, int z) { return padded[{x, y, z}] != 0; };
  for (int z = 0; z + 1 < n[2]; ++z)
    for (int y = 0; y + 1 < n[1]; ++y)
      for (int x = 0; x + 1 < n[0]; ++x)
        for (unsigned extent = 0; extent < 8; ++extent) {
          const int ex = extent & 1U ? 1 : 0;
          const int ey = extent & 2U ? 1 : 0;
          const int ez = extent & 4U ? 1 : 0;
          bool any = false;
          bool all = true;
          for (int c = 0; c <= ez; ++c)
            for (int b = 0; b <= ey; ++b)
              for (int a = 0; a <= ex; ++a) {
                any = any || at(x + a, y + b, z + c);
                all = all && at(x + a, y + b, z + c);
              }
          // The group spans `extent` axes: a cell of dimension 3 - extent among closed cubes, or a
          // cell of dimension extent among voxel centres.
          const int dimension = ex + ey + ez;
          if (is26 ? any : all) t.euler += (is26 ? 3 - dimension : dimension) % 2 == 0 ? 1 : -1;
        }
  t.cycles = t.components + t.cavities - t.euler;
  return t;
}

TEST(TopologyNumbers, agree_with_brute_force_on_noise_of_every_density) {
  Random random(4);
  std::int64_t cycles = 0;
  std::int64_t cavities = 0;
  for (int i = 0; i < 150; ++i) {
    const Voxel size{1 + random.below(12), 1 + random.below(9), 1 + random.below(9)};
    const Mask mask = test::noise_mask(size, random.uniform(), random);
    for (const Connectivity c : {Connectivity::k26, Connectivity::k6}) {
      const TopologyNumbers expected = by_brute_force(mask, c);
      EXPECT_EQ(topology_numbers(mask, c), expected);
      cycles += expected.cycles;
      cavities += expected.cavities;
    }
  }
  EXPECT_GT(cycles, 100);
  EXPECT_GT(cavities, 100);
}

TEST(TopologyNumbers, of_shapes_known_by_heart) {
  EXPECT_EQ(topology_numbers(empty_mask({5, 5, 5})), (TopologyNumbers{0, 0, 0, 0}));
  EXPECT_EQ(topology_numbers(Mask{}), (TopologyNumbers{0, 0, 0, 0}));
  EXPECT_EQ(topology_numbers(Mask(empty_mask({5, 4, 3}).grid, 1)), (TopologyNumbers{1, 0, 0, 1}));
  EXPECT_EQ(topology_numbers(mask_of({3, 3, 3}, {{1, 1, 1}})), (TopologyNumbers{1, 0, 0, 1}));
  Mask shell(empty_mask({5, 5, 5}).grid, 1);
  shell[{2, 2, 2}] = 0;
  EXPECT_EQ(topology_numbers(shell), (TopologyNumbers{1, 1, 0, 2}));
  EXPECT_EQ(topology_numbers(test::rings_mask(48, 16.0, 3.0)), (TopologyNumbers{1, 0, 7, -6}));
}

TEST(TopologyNumbers, two_voxels_at_a_vertex_are_one_piece_only_with_26) {
  const Mask mask = mask_of({4, 4, 4}, {{1, 1, 1}, {2, 2, 2}});
  EXPECT_EQ(topology_numbers(mask, Connectivity::k26).components, 1);
  EXPECT_EQ(topology_numbers(mask, Connectivity::k6).components, 2);
}

}  // namespace
}  // namespace angiospline
