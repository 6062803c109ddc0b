#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "recovery/centerlines/vessels_from_mask.h"
#include "tests/shapes/random_trees.h"
#include "tests/shapes/tree_match.h"

namespace angiospline {
namespace {

using test::empty_mask;

TEST(VesselsFromMask, find_exactly_the_branches_of_random_trees) {
  test::Match ends;
  test::Match junctions;
  test::Match branches;
  double offset = 0.0;
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    Random random(1000 + seed);
    test::RandomTreeOptions options;
    options.extent_mm = 100.0;
    options.root_radius_mm = 6.5;
    const CenterlineTree truth = test::RandomTree(options, random).grow();
    Mask mask = empty_mask({100, 100, 100});
    test::paint(mask, truth);
    const Vessels v = vessels_from_mask(mask).value();
    const test::TreeMatch m = test::match(truth, v.tree);
    ends += m.ends;
    junctions += m.junctions;
    branches += m.branches;
    EXPECT_LE(m.worst_tip_lost_mm, 2.0);
    const test::CenterlineErrors e = test::centerline_errors(truth, v.tree);
    offset = std::max(offset, e.mean_mm);
    EXPECT_LT(std::abs(e.radius_bias), 0.03);
    EXPECT_EQ(v.before, v.after);
  }
  EXPECT_GT(branches.truth, 30);
  EXPECT_GE(ends.f1(), 0.98);
  EXPECT_GE(junctions.f1(), 0.98);
  EXPECT_GE(branches.f1(), 0.98);
  EXPECT_LT(offset, 0.25);
}

// A tube cut flat: the ends are the cuts, the middle is the axis, the radius is right.
TEST(VesselsFromMask, measure_tubes_of_any_width_and_direction) {
  Random random(11);
  for (const double radius : {1.5, 2.0, 3.0, 5.0, 8.0, 12.0})
    for (int i = 0; i < 4; ++i) {
      const Vec3 axis = Vec3(random.gaussian(), random.gaussian(), random.gaussian()).normalized();
      const Vec3 center(45.0 + random.uniform(), 45.0 + random.uniform(), 45.0 + random.uniform());
      const Vec3 a = center - 27.0 * axis;
      const Vec3 b = center + 27.0 * axis;
      Mask mask = empty_mask({92, 92, 92});
      test::add_tube(mask, a, b, radius, test::Ends::kFlat);
      const CenterlineTree tree = vessels_from_mask(mask).value().tree;
      ASSERT_EQ(tree.branches.size(), 1U) << radius;
      const CenterlineBranch& branch = tree.branches[0];
      double worst = 0.0;
      for (Eigen::Index k = 0; k < branch.points_mm.cols(); ++k) {
        const Vec3 d = branch.points_mm.col(k) - center;
        worst = std::max(worst, (d - d.dot(axis) * axis).norm());
      }
      EXPECT_LT(worst, 0.4) << radius;
      EXPECT_NEAR(branch.radii_mm.mean() / radius, 1.0, radius < 3.0 ? 0.08 : 0.03) << radius;
      EXPECT_NEAR(length_mm(branch), 54.0, 1.5) << radius;
    }
}

// Slices three times as thick as the pixels, a vessel no thicker than two of them included.
TEST(VesselsFromMask, keep_radius_and_centre_of_tubes_in_thick_slices) {
  Random random(12);
  for (const double radius : {3.0, 5.0}) {
    double width = 0.0;
    double off_vox = 0.0;
    int points = 0;
    for (int i = 0; i < 6; ++i) {
      const Vec3 axis = Vec3(random.gaussian(), random.gaussian(), random.gaussian()).normalized();
      const Vec3 center(45.0 + random.uniform(), 45.0 + random.uniform(), 45.0 + random.uniform());
      Mask mask = empty_mask({92, 92, 30}, Vec3(1, 1, 3));
      test::add_tube(mask, center - 27.0 * axis, center + 27.0 * axis, radius, test::Ends::kFlat);
      const CenterlineTree tree = vessels_from_mask(mask).value().tree;
      ASSERT_EQ(tree.branches.size(), 1U) << radius;
      const CenterlineBranch& branch = tree.branches[0];
      for (Eigen::Index k = 0; k < branch.points_mm.cols(); ++k) {
        const Vec3 d = branch.points_mm.col(k) - center;
        const Vec3 across = d - d.dot(axis) * axis;
        off_vox += across.cwiseQuotient(mask.grid.spacing_mm).norm();
        width += branch.radii_mm[k] / radius;
        ++points;
      }
    }
    EXPECT_GT(points, 200);
    EXPECT_NEAR(width / points, 1.0, 0.03) << radius;
    EXPECT_LT(off_vox / points, 0.3) << radius;
  }
}

TEST(VesselsFromMask, honour_spacing_origin_and_direction) {
  Mask mask = empty_mask({120, 100, 40}, Vec3(1, 1, 3));
  mask.grid.direction << 0.8, 0.6, 0, -0.6, 0.8, 0, 0, 0, 1;
  mask.grid.origin_mm = Vec3(-30, 50, 7);
  const Vec3 a = mask.grid.world_mm(Vec3(20, 20, 8));
  const Vec3 b = mask.grid.world_mm(Vec3(100, 70, 30));
  const Vec3 axis = (b - a).normalized();
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) {
    const Vec3 d = mask.grid.world_mm(mask.grid.voxel(i)) - a;
    const double s = d.dot(axis);
    mask.voxels[i] = s >= 0 && s <= (b - a).norm() && (d - s * axis).norm() <= 9.0 ? 1 : 0;
  }
  const CenterlineTree tree = vessels_from_mask(mask).value().tree;
  ASSERT_EQ(tree.branches.size(), 1U);
  const CenterlineBranch& branch = tree.branches[0];
  for (Eigen::Index k = 0; k < branch.points_mm.cols(); ++k) {
    const Vec3 d = branch.points_mm.col(k) - a;
    EXPECT_LT((d - d.dot(axis) * axis).norm(), 0.5);
    EXPECT_NEAR(branch.radii_mm[k], 9.0, 0.4);
  }
  EXPECT_NEAR(length_mm(branch), (b - a).norm(), 3.0);
}

TEST(VesselsFromMask, keep_a_pure_ring_as_one_closed_branch) {
  Mask mask = empty_mask({60, 60, 20});
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) {
    const Voxel v = mask.grid.voxel(i);
    const double ring = std::hypot(v[0] - 29.3, v[1] - 30.1) - 20.0;
    mask.voxels[i] = std::hypot(ring, v[2] - 9.6) <= 4.0 ? 1 : 0;
  }
  const CenterlineTree tree = vessels_from_mask(mask).value().tree;
  ASSERT_EQ(tree.branches.size(), 1U);
  EXPECT_EQ(cycle_count(tree), 1);
  EXPECT_TRUE(tree.inlets.empty());
  const CenterlineBranch& b = tree.branches[0];
  for (Eigen::Index k = 0; k < b.points_mm.cols(); ++k) {
    EXPECT_NEAR(std::hypot(b.points_mm(0, k) - 29.3, b.points_mm(1, k) - 30.1), 20.0, 0.3);
    EXPECT_NEAR(b.points_mm(2, k), 9.6, 0.3);
    EXPECT_NEAR(b.radii_mm[k], 4.0, 0.12);
  }
}

TEST(VesselsFromMask, name_the_inlet_given_or_else_the_thickest_end) {
  Mask mask = empty_mask({90, 60, 40});
  test::add_tube(mask, Vec3(10, 30, 20), Vec3(45, 30, 20), 7.0);
  test::add_tube(mask, Vec3(45, 30, 20), Vec3(80, 50, 20), 4.0);
  test::add_tube(mask, Vec3(45, 30, 20), Vec3(80, 12, 20), 5.0);
  const Vessels own = vessels_from_mask(mask).value();
  ASSERT_EQ(own.tree.inlets.size(), 1U);
  EXPECT_LT(own.tree.nodes[static_cast<std::size_t>(own.tree.inlets[0])].position_mm[0], 15.0);
  VesselsOptions options;
  options.roots_mm = {Vec3(85, 8, 20)};
  const Vessels given = vessels_from_mask(mask, options).value();
  ASSERT_EQ(given.tree.inlets.size(), 1U);
  EXPECT_LT((given.tree.nodes[static_cast<std::size_t>(given.tree.inlets[0])].position_mm -
             Vec3(80, 12, 20))
                .norm(),
            6.0);
  EXPECT_EQ(given.graph.nodes[0].level, 0);
  EXPECT_EQ(given.graph.nodes[0].arcs.size(), 1U);
}

TEST(VesselsFromMask, give_radii_that_are_positive_and_points_that_meet_their_nodes) {
  Random random(12);
  int branches = 0;
  for (int i = 0; i < 20; ++i) {
    const Mask mask = test::blob_mask({18, 18, 18}, random.uniform(0.4, 0.6), random);
    const auto v = vessels_from_mask(mask);
    if (!v) continue;
    for (const CenterlineBranch& b : v->tree.branches) {
      ASSERT_GE(b.points_mm.cols(), 2);
      EXPECT_GT(b.radii_mm.minCoeff(), 0.0);
      EXPECT_TRUE(b.points_mm.allFinite());
      EXPECT_EQ(b.points_mm.leftCols<1>(),
                v->tree.nodes[static_cast<std::size_t>(b.from)].position_mm);
      EXPECT_EQ(b.points_mm.rightCols<1>(),
                v->tree.nodes[static_cast<std::size_t>(b.to)].position_mm);
      ++branches;
    }
    if (v->before.cavities == 0) {
      int hidden = 0;
      for (const VesselNode& n : v->graph.nodes) hidden += n.cluster_cycles;
      EXPECT_EQ(cycle_count(v->tree) + hidden, v->before.cycles);
    }
  }
  EXPECT_GT(branches, 500);
}

TEST(VesselsFromMask, give_the_same_bits_on_one_thread_and_on_four) {
  Random random(1003);
  const CenterlineTree truth = test::RandomTree({}, random).grow();
  Mask mask = empty_mask({120, 120, 120});
  test::paint(mask, truth);
  Vessels alone;
  {
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    alone = vessels_from_mask(mask).value();
  }
  const tbb::global_control four(tbb::global_control::max_allowed_parallelism, 4);
  const Vessels many = vessels_from_mask(mask).value();
  ASSERT_EQ(many.tree.branches.size(), alone.tree.branches.size());
  for (std::size_t b = 0; b < alone.tree.branches.size(); ++b) {
    EXPECT_EQ(many.tree.branches[b].points_mm, alone.tree.branches[b].points_mm);
    EXPECT_EQ(many.tree.branches[b].radii_mm, alone.tree.branches[b].radii_mm);
    EXPECT_EQ(many.tree.branches[b].name, alone.tree.branches[b].name);
  }
}

// Thinning takes voxels by the parity of their coordinates and ties go to the first voxel, so a
// turned mask gives other voxels; branches, junctions and ends are the same, and the smoothed lines
// nearly so.
TEST(VesselsFromMask, find_the_same_tree_in_all_48_orientations) {
  Random random(1004);
  test::RandomTreeOptions small;
  small.extent_mm = 90.0;
  small.root_radius_mm = 4.5;
  small.least_radius_mm = 1.5;
  Mask mask = empty_mask({90, 90, 90});
  test::paint(mask, test::RandomTree(small, random).grow());
  const auto lengths = [](const Mask& m) {
    const CenterlineTree tree = vessels_from_mask(m).value().tree;
    std::vector<double> sorted;
    for (const CenterlineBranch& b : tree.branches) sorted.push_back(length_mm(b));
    std::sort(sorted.begin(), sorted.end());
    return sorted;
  };
  const std::vector<double> expected = lengths(mask);
  ASSERT_GE(expected.size(), 5U);
  std::array<int, 3> axes{0, 1, 2};
  do
    for (unsigned m = 0; m < 8; ++m) {
      const auto found =
          lengths(test::turned(mask, axes, {(m & 1U) != 0, (m & 2U) != 0, (m & 4U) != 0}));
      ASSERT_EQ(found.size(), expected.size());
      for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], expected[i], 1.5);
    }
  while (std::next_permutation(axes.begin(), axes.end()));
}

TEST(VesselsFromMask, say_what_is_wrong_with_a_mask_that_has_no_vessel) {
  const auto empty = vessels_from_mask(empty_mask({5, 5, 5}));
  ASSERT_FALSE(empty.has_value());
  EXPECT_EQ(empty.error().message(), "mask is empty (at least one voxel must be foreground)");
  Mask whole = empty_mask({5, 5, 5});
  std::fill(whole.voxels.begin(), whole.voxels.end(), std::uint8_t{1});
  const auto full = vessels_from_mask(whole);
  ASSERT_FALSE(full.has_value());
  EXPECT_NE(full.error().message().find("mask is full"), std::string::npos);
  const auto voxel = vessels_from_mask(test::mask_of({5, 5, 5}, {{2, 2, 2}}));
  ASSERT_FALSE(voxel.has_value());
  EXPECT_NE(voxel.error().message().find("no branch"), std::string::npos);
}

}  // namespace
}  // namespace angiospline
