#include <gtest/gtest.h>

#include "recovery/centerlines/vessels_from_mask.h"
#include "recovery/imaging/skeleton/junction_merging.h"
#include "recovery/imaging/skeleton/thinning.h"
#include "tests/shapes/small_masks.h"

namespace angiospline {
namespace {

TEST(JunctionMerging, makes_one_junction_where_three_to_six_vessels_meet) {
  Random random(5);
  int merged = 0;
  for (int n = 3; n <= 6; ++n)
    for (int repeat = 0; repeat < 5; ++repeat) {
      const Vec3 center(50 + random.uniform(), 50 + random.uniform(), 50 + random.uniform());
      const double radius = random.uniform(3.0, 7.0);
      std::vector<Vec3> directions;
      while (static_cast<int>(directions.size()) < n) {
        const Vec3 d = Vec3(random.gaussian(), random.gaussian(), random.gaussian()).normalized();
        if (std::all_of(directions.begin(), directions.end(),
                        [&](const Vec3& e) { return e.dot(d) < 0.4; }))
          directions.push_back(d);
      }
      Mask mask = test::empty_mask({100, 100, 100});
      for (const Vec3& d : directions) test::add_tube(mask, center, center + 40.0 * d, radius);
      const Vessels v = vessels_from_mask(mask).value();
      ASSERT_EQ(v.tree.branches.size(), static_cast<std::size_t>(n));
      ASSERT_EQ(v.tree.nodes.size(), static_cast<std::size_t>(n) + 1);
      merged += v.merged;
      const auto at = branches_at_nodes(v.tree);
      for (std::size_t k = 0; k < at.size(); ++k) {
        if (at[k].size() == static_cast<std::size_t>(n)) {
          EXPECT_LT((v.tree.nodes[k].position_mm - center).norm(), 0.4 * radius);
        }
      }
    }
  EXPECT_GT(merged, 0) << "no case needed a merge";
}

TEST(JunctionMerging, keeps_components_cycles_and_chains_of_random_axes) {
  Random random(21);
  int merged = 0;
  for (int i = 0; i < 100; ++i) {
    const Mask mask = test::blob_mask({20, 20, 20}, random.uniform(0.4, 0.55), random);
    const VesselGraph before = vessel_graph(label_skeleton(thin(mask).value()));
    const VesselGraph after = merge_close_junctions(before, mask, random.uniform(0.0, 4.0));
    ASSERT_EQ(after.component_count(), before.component_count());
    ASSERT_EQ(after.cycle_count(), before.cycle_count());
    EXPECT_EQ(after.multiple_parent_count(), after.cycle_count());
    merged += static_cast<int>(before.nodes.size() - after.nodes.size());
    for (const VesselArc& a : after.arcs) {
      EXPECT_EQ(a.voxels.front(), after.nodes[static_cast<std::size_t>(a.from)].voxel);
      EXPECT_EQ(a.voxels.back(), after.nodes[static_cast<std::size_t>(a.to)].voxel);
      for (std::size_t k = 1; k < a.voxels.size(); ++k)
        for (std::size_t c = 0; c < 3; ++c)
          EXPECT_LE(std::abs(a.voxels[k][c] - a.voxels[k - 1][c]), 1);
    }
  }
  EXPECT_GT(merged, 100);
}

TEST(JunctionMerging, does_nothing_at_distance_zero) {
  const Mask mask = test::rings_mask(48, 16.0, 3.0);
  const VesselGraph before = vessel_graph(label_skeleton(thin(mask).value()));
  EXPECT_EQ(level_order_table(merge_close_junctions(before, mask, 0.0)), level_order_table(before));
}

}  // namespace
}  // namespace angiospline
