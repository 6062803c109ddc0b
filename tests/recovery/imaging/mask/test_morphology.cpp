#include <queue>

#include <gtest/gtest.h>

#include "base/random.h"
#include "recovery/imaging/mask/morphology.h"

namespace angiospline {
namespace {

Mask empty(int x, int y, int z) {
  ImageGrid g;
  g.size = {x, y, z};
  return Mask(g);
}

Mask random_mask(std::uint64_t seed, double share, Voxel size = {13, 9, 11}) {
  Random random(seed);
  Mask m = empty(size[0], size[1], size[2]);
  for (auto& v : m.voxels) v = random.uniform() < share;
  return m;
}

int reach(Neighbours c) { return c == Neighbours::kFaces6 ? 1 : c == Neighbours::kEdges18 ? 2 : 3; }

// Labels by plain flood fill.
Image<std::int32_t> flooded(const Mask& m, bool foreground, Neighbours c) {
  Image<std::int32_t> labels(m.grid);
  int next = 0;
  for (std::size_t i = 0; i < m.voxels.size(); ++i) {
    if ((m.voxels[i] != 0) != foreground || labels.voxels[i]) continue;
    labels.voxels[i] = ++next;
    std::queue<Voxel> queue({m.grid.voxel(i)});
    for (; !queue.empty(); queue.pop())
      for (int z = -1; z <= 1; ++z)
        for (int y = -1; y <= 1; ++y)
          for (int x = -1; x <= 1; ++x) {
            const Voxel v = queue.front(), n{v[0] + x, v[1] + y, v[2] + z};
            if (std::abs(x) + std::abs(y) + std::abs(z) > reach(c) || !m.grid.contains(n)) continue;
            if ((m[n] != 0) != foreground || labels[n]) continue;
            labels[n] = next;
            queue.push(n);
          }
  }
  return labels;
}

constexpr Neighbours kAll[] = {Neighbours::kFaces6, Neighbours::kEdges18, Neighbours::kCorners26};

TEST(Morphology, ComponentsAreThoseOfAFloodFill) {
  std::size_t seen = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed)
    for (const Neighbours c : kAll) {
      const Mask m = random_mask(seed, 0.05 + 0.02 * static_cast<double>(seed % 20));
      const Components found = connected_components(m, c);
      EXPECT_EQ(found.labels.voxels, flooded(m, true, c).voxels) << seed;
      EXPECT_EQ(component_count(m, c), found.list.size());
      std::size_t total = 0;
      for (const Component& k : found.list) total += k.voxels;
      EXPECT_EQ(total, voxel_count(m));
      seen += found.list.size();
    }
  EXPECT_GT(seen, 1000U);
}

TEST(Morphology, CavitiesAreTheBackgroundThatReachesNoBorder) {
  std::size_t filled = 0;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const Mask m = random_mask(seed, 0.75);
    const Image<std::int32_t> labels = flooded(m, false, Neighbours::kFaces6);
    std::vector<char> open(m.voxels.size() + 1, 0);
    for (std::size_t i = 0; i < m.voxels.size(); ++i) {
      const Voxel v = m.grid.voxel(i);
      for (std::size_t k = 0; k < 3; ++k)
        if (v[k] == 0 || v[k] == m.grid.size[k] - 1)
          open[static_cast<std::size_t>(labels.voxels[i])] = 1;
    }
    const Filled f = fill_cavities(m);
    for (std::size_t i = 0; i < m.voxels.size(); ++i)
      EXPECT_EQ(f.mask.voxels[i] != 0,
                m.voxels[i] != 0 || !open[static_cast<std::size_t>(labels.voxels[i])]);
    EXPECT_EQ(voxel_count(f.mask), voxel_count(m) + f.voxels);
    filled += f.regions;
  }
  EXPECT_GT(filled, 50U);
}

TEST(Morphology, CavitiesAboveTheLimitStayOpen) {
  Mask m = empty(9, 9, 9);
  for (int z = 1; z < 8; ++z)
    for (int y = 1; y < 8; ++y)
      for (int x = 1; x < 8; ++x) m[{x, y, z}] = 1;
  for (int x = 3; x < 6; ++x) m[{x, 4, 4}] = 0;
  EXPECT_EQ(fill_cavities(m, 2).voxels, 0U);
  EXPECT_EQ(fill_cavities(m, 3).voxels, 3U);
}

TEST(Morphology, AThinTunnelIsAHoleAndAWideLoopIsNot) {
  Mask ring = empty(12, 12, 5);
  for (int z = 1; z < 4; ++z)
    for (int y = 1; y < 11; ++y)
      for (int x = 1; x < 11; ++x) ring[{x, y, z}] = x < 4 || x > 7 || y < 3 || y > 8;
  Mask tunnel = ring;
  for (int z = 0; z < 5; ++z) tunnel[{9, 5, z}] = 0;
  const Filled f = fill_holes(tunnel, 4);
  EXPECT_EQ((f.mask[{9, 5, 1}]), 1);
  EXPECT_EQ((f.mask[{9, 5, 3}]), 1);
  EXPECT_EQ((f.mask[{9, 5, 0}]), 0);  // outside the ring, above it
  EXPECT_EQ((f.mask[{5, 5, 2}]), 0);  // the loop itself
}

TEST(Morphology, DilationOfOneVoxelIsItsNeighbourhood) {
  Mask m = empty(9, 9, 9);
  m[{4, 4, 4}] = 200;  // any value but 0 is foreground
  EXPECT_EQ(voxel_count(dilate(m, 1, Neighbours::kFaces6)), 7U);
  EXPECT_EQ(voxel_count(dilate(m, 1, Neighbours::kEdges18)), 19U);
  EXPECT_EQ(voxel_count(dilate(m, 1, Neighbours::kCorners26)), 27U);
  EXPECT_EQ(voxel_count(dilate(m, 2, Neighbours::kFaces6)), 25U);  // octahedron
  EXPECT_EQ(voxel_count(dilate(m, 0, Neighbours::kFaces6)), 1U);
}

TEST(Morphology, ErosionIsDilationOfTheComplement) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed)
    for (const Neighbours c : kAll) {
      const Mask m = random_mask(seed, 0.8);
      Mask complement = m;
      for (auto& v : complement.voxels) v = v == 0;
      const Mask a = erode(m, 2, c), b = dilate(complement, 2, c);
      for (std::size_t i = 0; i < a.voxels.size(); ++i)
        ASSERT_NE(a.voxels[i] != 0, b.voxels[i] != 0);
    }
}

TEST(Morphology, ClosingContainsTheMaskAndIsIdempotent) {
  std::size_t added = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed)
    for (const Neighbours c : kAll) {
      const Mask m = random_mask(seed, 0.3);
      const Mask once = close(m, 1, c);
      for (std::size_t i = 0; i < m.voxels.size(); ++i) {
        ASSERT_GE(once.voxels[i], m.voxels[i]);
        added += once.voxels[i] && !m.voxels[i];
      }
      EXPECT_EQ(close(once, 1, c).voxels, once.voxels);
    }
  EXPECT_GT(added, 0U);
}

TEST(Morphology, ClosingDoesNotGrowAlongTheBorder) {
  Mask m = empty(6, 6, 6);
  m[{0, 0, 0}] = 1;
  m[{5, 3, 3}] = 1;
  EXPECT_EQ(close(m, 2, Neighbours::kCorners26).voxels, m.voxels);
}

TEST(Morphology, KeepsTheLargestComponentAndTheFirstOfEquals) {
  Mask m = empty(8, 3, 3);
  m[{0, 0, 0}] = m[{1, 0, 0}] = 1;
  m[{4, 0, 0}] = m[{5, 0, 0}] = 1;
  m[{7, 2, 2}] = 1;
  const Mask largest = largest_component(m);
  EXPECT_EQ(voxel_count(largest), 2U);
  EXPECT_EQ((largest[{0, 0, 0}]), 1);
  EXPECT_EQ(voxel_count(without_small_components(m, 2)), 4U);
}

TEST(Morphology, EmptyAndFullMasksHaveStatedAnswers) {
  const Mask none = empty(4, 4, 4);
  Mask full = none;
  for (auto& v : full.voxels) v = 1;
  EXPECT_EQ(component_count(none, Neighbours::kFaces6), 0U);
  EXPECT_EQ(component_count(full, Neighbours::kFaces6), 1U);
  EXPECT_EQ(largest_component(none).voxels, none.voxels);
  EXPECT_EQ(fill_cavities(none).voxels, 0U);
  EXPECT_EQ(fill_holes(none, 100).voxels, 0U);
  EXPECT_EQ(erode(full).voxels, full.voxels);  // beyond the image counts as foreground
  EXPECT_EQ(dilate(none).voxels, none.voxels);
}

}  // namespace
}  // namespace angiospline
