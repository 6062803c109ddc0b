#include <vector>

#include <gtest/gtest.h>

#include "base/random.h"
#include "recovery/imaging/mask/neighborhood.h"

namespace angiospline {
namespace {

// The definitions, spelled out by flood fill: slow and plain.
struct Pieces {
  int all = 0;       // pieces of the set
  int touching = 0;  // pieces with a voxel on a face of the centre
};

Pieces count_pieces(Block set, int adjacency) {
  std::vector<Voxel> voxels;
  for (const Voxel& d : kNeighbors)
    if (set & block_bit(d)) voxels.push_back(d);
  Pieces pieces;
  std::vector<bool> seen(voxels.size(), false);
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    if (seen[i]) continue;
    std::vector<std::size_t> stack{i};
    seen[i] = true;
    bool touches = false;
    while (!stack.empty()) {
      const Voxel a = voxels[stack.back()];
      stack.pop_back();
      touches = touches || std::abs(a[0]) + std::abs(a[1]) + std::abs(a[2]) == 1;
      for (std::size_t j = 0; j < voxels.size(); ++j) {
        const int dx = std::abs(a[0] - voxels[j][0]);
        const int dy = std::abs(a[1] - voxels[j][1]);
        const int dz = std::abs(a[2] - voxels[j][2]);
        const bool adjacent = adjacency == 26 ? std::max({dx, dy, dz}) == 1 : dx + dy + dz == 1;
        if (!adjacent || seen[j]) continue;
        seen[j] = true;
        stack.push_back(j);
      }
    }
    ++pieces.all;
    pieces.touching += touches ? 1 : 0;
  }
  return pieces;
}

Block without_vertices(Block set) {
  for (std::size_t k = 18; k < 26; ++k) set &= ~block_bit(kNeighbors[k]);
  return set;
}

bool is_simple_by_definition(Block block, Connectivity c) {
  const Block foreground = block & ~kBlockCenter;
  const Block background = ~block & kBlockAll & ~kBlockCenter;
  const Block six = c == Connectivity::k26 ? background : foreground;
  const Block other = c == Connectivity::k26 ? foreground : background;
  return count_pieces(without_vertices(six), 6).touching == 1 && count_pieces(other, 26).all == 1;
}

// Euler characteristic of the closed cubes of a block.
int euler(Block block) {
  int sum = 0;
  for (int z = 0; z <= 6; ++z)
    for (int y = 0; y <= 6; ++y)
      for (int x = 0; x <= 6; ++x) {  // a cell in doubled coordinates, cubes at the odd ones
        bool present = false;
        for (int c = 0; c < 27; ++c) {
          const int dx = std::abs(2 * (c % 3) + 1 - x);
          const int dy = std::abs(2 * (c / 3 % 3) + 1 - y);
          const int dz = std::abs(2 * (c / 9) + 1 - z);
          if ((block >> c & 1U) && std::max({dx, dy, dz}) <= 1) present = true;
        }
        if (present) sum += (x % 2 + y % 2 + z % 2) % 2 == 0 ? 1 : -1;
      }
  return sum;
}

Block random_block(Random& random) {
  const double density = random.uniform(0.1, 0.9);
  Block block = kBlockCenter;
  for (const Voxel& d : kNeighbors)
    if (random.uniform() < density) block |= block_bit(d);
  return block;
}

TEST(SimplePoint, agrees_with_the_definition_on_random_blocks_of_every_density) {
  Random random(1);
  int simple = 0;
  for (int i = 0; i < 40000; ++i) {
    const Block block = random_block(random);
    for (const Connectivity c : {Connectivity::k26, Connectivity::k6}) {
      ASSERT_EQ(is_simple(block, c), is_simple_by_definition(block, c)) << std::hex << block;
      simple += is_simple(block, c) ? 1 : 0;
    }
  }
  EXPECT_GT(simple, 4000);
}

TEST(SimplePoint, agrees_with_the_definition_on_every_flat_block) {
  for (unsigned ring = 0; ring < 256; ++ring) {
    Block block = kBlockCenter;
    unsigned bit = 0;
    for (const Voxel& d : kNeighbors)
      if (d[2] == 0 && (ring >> bit++ & 1U)) block |= block_bit(d);
    for (const Connectivity c : {Connectivity::k26, Connectivity::k6})
      EXPECT_EQ(is_simple(block, c), is_simple_by_definition(block, c)) << ring;
  }
}

// Thesis 4.2: surface connectivity (the Euler characteristic, Lobregt) and object connectivity
// together.
TEST(SimplePoint, is_the_thesis_pair_of_conditions) {
  Random random(2);
  int only_surface = 0;
  for (int i = 0; i < 4000; ++i) {
    const Block block = random_block(random);
    const bool surface = euler(block) == euler(block & ~kBlockCenter);
    const bool object = count_pieces(block & ~kBlockCenter, 26).all == 1;
    ASSERT_EQ(is_simple(block, Connectivity::k26), surface && object) << std::hex << block;
    only_surface += surface && !object ? 1 : 0;
  }
  EXPECT_GT(only_surface, 0) << "figure 4.5: the first condition alone is not enough";
}

TEST(SimplePoint, is_the_same_in_all_orientations) {
  Random random(3);
  for (int i = 0; i < 2000; ++i) {
    const Block block = random_block(random);
    Block mirrored = kBlockCenter;
    Block turned = kBlockCenter;
    for (const Voxel& d : kNeighbors) {
      if (!(block & block_bit(d))) continue;
      mirrored |= block_bit({-d[0], d[1], d[2]});
      turned |= block_bit({d[1], d[2], d[0]});
    }
    for (const Connectivity c : {Connectivity::k26, Connectivity::k6}) {
      EXPECT_EQ(is_simple(block, c), is_simple(mirrored, c));
      EXPECT_EQ(is_simple(block, c), is_simple(turned, c));
    }
  }
}

TEST(SimplePoint, leaves_isolated_and_inner_voxels_alone) {
  for (const Connectivity c : {Connectivity::k26, Connectivity::k6}) {
    EXPECT_FALSE(is_simple(kBlockCenter, c));
    EXPECT_FALSE(is_simple(kBlockAll, c));
  }
}

TEST(EndPoint, has_one_neighbour_of_the_connectivity) {
  const Block by_face = kBlockCenter | block_bit({1, 0, 0});
  const Block by_vertex = kBlockCenter | block_bit({1, 1, 1});
  EXPECT_TRUE(is_end_point(by_face, Connectivity::k26));
  EXPECT_TRUE(is_end_point(by_vertex, Connectivity::k26));
  EXPECT_TRUE(is_end_point(by_face, Connectivity::k6));
  EXPECT_FALSE(is_end_point(by_vertex, Connectivity::k6));
  EXPECT_FALSE(is_end_point(by_face | by_vertex, Connectivity::k26));
  EXPECT_FALSE(is_end_point(kBlockCenter, Connectivity::k26));
  const Block staircase = by_face | block_bit({1, 1, 0}) | block_bit({1, 1, 1});
  const Block tooth = by_face | block_bit({1, 1, 0}) | block_bit({1, -1, 0});
  EXPECT_TRUE(is_end_point(staircase, Connectivity::k6));
  EXPECT_FALSE(is_end_point(tooth, Connectivity::k6));
}

}  // namespace
}  // namespace angiospline
