#include <gtest/gtest.h>

#include "recovery/imaging/mask/topology_numbers.h"
#include "recovery/imaging/skeleton/pruning.h"
#include "recovery/imaging/skeleton/thinning.h"
#include "tests/shapes/small_masks.h"

namespace angiospline {
namespace {

PrunedSkeleton pruned(const Mask& mask, const PruningOptions& options = {}) {
  ThinningOptions thinning;
  thinning.connectivity = options.connectivity;
  return prune_twigs(mask, thin(mask, thinning).value(), options).value();
}

TEST(Pruning, keeps_components_cavities_and_cycles_of_random_masks) {
  Random random(9);
  int twigs = 0;
  for (int i = 0; i < 400; ++i) {
    const Mask mask = i % 2 == 0
                          ? test::blob_mask({20, 20, 20}, random.uniform(0.4, 0.6), random)
                          : test::noise_mask({14, 14, 14}, random.uniform(0.05, 0.4), random);
    PruningOptions options;
    options.radii = random.uniform(0.0, 4.0);
    if (i % 3 == 0) options.connectivity = Connectivity::k6;
    const PrunedSkeleton p = pruned(mask, options);
    ASSERT_EQ(topology_numbers(p.skeleton, options.connectivity),
              topology_numbers(mask, options.connectivity));
    twigs += p.twigs;
  }
  EXPECT_GT(twigs, 1000);
}

TEST(Pruning, leaves_nothing_that_its_rule_calls_a_twig) {
  Random random(10);
  for (int i = 0; i < 50; ++i) {
    const Mask mask = test::blob_mask({24, 24, 24}, random.uniform(0.42, 0.5), random);
    const PrunedSkeleton once = pruned(mask);
    const PrunedSkeleton twice = prune_twigs(mask, once.skeleton).value();
    EXPECT_EQ(twice.twigs, 0);
    EXPECT_EQ(twice.skeleton.voxels, once.skeleton.voxels);
  }
}

TEST(Pruning, leaves_one_curve_of_a_thick_tube) {
  for (const double radius : {2.0, 5.0, 9.0, 14.0}) {
    Mask mask = test::empty_mask({110, 60, 60});
    test::add_tube(mask, Vec3(20, 28, 27), Vec3(90, 31, 33), radius);
    const PrunedSkeleton p = pruned(mask);
    EXPECT_EQ(p.graph.arcs.size(), 1U) << radius;
    EXPECT_EQ(p.graph.nodes.size(), 2U) << radius;
  }
}

// The rule is about shape, not about voxels: a side branch as long as wide goes, a slender one of
// the same length stays.
TEST(Pruning, judges_a_side_branch_by_its_own_width) {
  const auto arcs_with_side_branch = [](double radius, double beyond) {
    Mask mask = test::empty_mask({100, 60, 60});
    test::add_tube(mask, Vec3(10, 25, 30), Vec3(90, 25, 30), 8.0);
    test::add_tube(mask, Vec3(50, 25, 30), Vec3(50, 33 + beyond, 30), radius, test::Ends::kFlat);
    return pruned(mask).graph.arcs.size();
  };
  EXPECT_EQ(arcs_with_side_branch(6.0, 6.0), 1U);
  EXPECT_EQ(arcs_with_side_branch(1.5, 6.0), 3U);
  EXPECT_EQ(arcs_with_side_branch(6.0, 18.0), 3U);
}

TEST(Pruning, keeps_loops_whatever_their_size) {
  PruningOptions hard;
  hard.radii = 100.0;
  const Mask rings = test::rings_mask(64, 22.0, 3.2);
  EXPECT_EQ(pruned(rings, hard).graph.cycle_count(), 7);
}

TEST(Pruning, counts_lengths_in_millimetres) {
  for (const double scale : {0.01, 1.0, 50.0}) {
    Mask mask = test::empty_mask({80, 50, 50}, Vec3::Constant(scale));
    test::add_tube(mask, scale * Vec3(10, 25, 25), scale * Vec3(70, 25, 25), scale * 6.0);
    test::add_tube(mask, scale * Vec3(40, 25, 25), scale * Vec3(40, 46, 25), scale * 2.0);
    const PrunedSkeleton p = pruned(mask);
    EXPECT_EQ(p.graph.arcs.size(), 3U) << "results do not depend on scale: " << scale;
  }
}

TEST(Pruning, accepts_an_empty_mask_and_stops_when_asked_to) {
  EXPECT_TRUE(pruned(test::empty_mask({5, 5, 5})).graph.nodes.empty());
  Progress progress;
  progress.stop_requested = [] { return true; };
  const Mask mask = test::rings_mask(32, 10.0, 3.0);
  EXPECT_FALSE(prune_twigs(mask, mask, {}, progress).has_value());
}

}  // namespace
}  // namespace angiospline
