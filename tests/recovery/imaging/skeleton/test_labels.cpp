#include <algorithm>
#include <map>

#include <gtest/gtest.h>

#include "recovery/imaging/skeleton/labels.h"
#include "recovery/imaging/skeleton/thinning.h"
#include "tests/shapes/printed_junctions.h"
#include "tests/shapes/small_masks.h"

namespace angiospline {
namespace {

using test::mask_of;
using test::PrintedJunction;

Mask junction_mask(const PrintedJunction& junction) {
  std::vector<Voxel> voxels = junction.exits;
  for (const auto& [voxel, weight] : junction.points) voxels.push_back(voxel);
  return mask_of({256, 256, 256}, voxels);
}

void expect_as_printed(const PrintedJunction& printed, const SkeletonLabels& labels) {
  ASSERT_EQ(labels.clusters.size(), 1U);
  const JunctionCluster& c = labels.clusters[0];
  EXPECT_EQ(labels.voxel(c.junction), printed.main);
  std::map<Voxel, int> found;
  for (std::size_t i = 0; i < c.members.size(); ++i)
    found[labels.voxel(c.members[i])] = c.weights[i];
  std::map<Voxel, int> points;
  for (const auto& [voxel, weight] : printed.points) points[voxel] = weight;
  EXPECT_EQ(found, points);
  std::vector<Voxel> exits;
  for (const int e : c.exits) exits.push_back(labels.voxel(e));
  std::vector<Voxel> expected = printed.exits;
  std::sort(exits.begin(), exits.end());
  std::sort(expected.begin(), expected.end());
  EXPECT_EQ(exits, expected);
  EXPECT_EQ(c.cycles, 0);
}

TEST(SkeletonLabels, give_the_junction_of_figure_7_20_voxel_by_voxel) {
  const PrintedJunction printed = test::figure_7_20();
  expect_as_printed(printed, label_skeleton(junction_mask(printed)));
}

TEST(SkeletonLabels, give_the_six_junctions_of_figure_7_21_voxel_by_voxel) {
  for (const PrintedJunction& printed : test::figure_7_21())
    expect_as_printed(printed, label_skeleton(junction_mask(printed)));
}

// What the thesis prints is an axis already: thinning with the exits as ends must not touch it.
TEST(SkeletonLabels, figure_7_20_and_7_21_are_one_voxel_thick_by_our_thinning) {
  std::vector<PrintedJunction> all = test::figure_7_21();
  all.push_back(test::figure_7_20());
  for (const PrintedJunction& printed : all) {
    const Mask mask = junction_mask(printed);
    EXPECT_EQ(thin(mask).value().voxels, mask.voxels);
  }
}

TEST(SkeletonLabels, tell_ends_from_normal_and_isolated_voxels) {
  const SkeletonLabels s =
      label_skeleton(mask_of({9, 9, 9}, {{1, 1, 1}, {2, 2, 2}, {3, 2, 2}, {7, 7, 7}}));
  EXPECT_EQ(s.labels, (std::vector<PointLabel>{PointLabel::kEnd, PointLabel::kNormal,
                                               PointLabel::kEnd, PointLabel::kIsolated}));
  EXPECT_TRUE(s.clusters.empty());
}

// Figure 4.9: B touches A and C by edges and one branch by an edge; A and C have a weaker third
// hold.
TEST(SkeletonLabels, the_heaviest_of_three_voxels_is_the_junction) {
  const SkeletonLabels s = label_skeleton(mask_of(
      {9, 9, 3}, {{1, 4, 1}, {2, 4, 1}, {3, 4, 1}, {4, 5, 1}, {4, 3, 1}, {5, 6, 1}, {5, 2, 1}}));
  ASSERT_EQ(s.clusters.size(), 1U);
  EXPECT_EQ(s.voxel(s.clusters[0].junction), (Voxel{3, 4, 1}));
  EXPECT_EQ(s.clusters[0].exits.size(), 3U);
}

TEST(SkeletonLabels, with_6_connectivity_see_faces_alone) {
  const Mask corner = mask_of({5, 5, 5}, {{1, 1, 1}, {2, 1, 1}, {2, 2, 1}, {2, 2, 2}});
  const SkeletonLabels s = label_skeleton(corner, Connectivity::k6);
  EXPECT_TRUE(s.clusters.empty());
  EXPECT_EQ(std::count(s.labels.begin(), s.labels.end(), PointLabel::kNormal), 2);
  EXPECT_EQ(label_skeleton(corner).clusters.size(), 1U) << "with 26 the corners touch three others";
}

TEST(SkeletonLabels, count_the_tunnels_within_a_cluster) {
  std::vector<Voxel>
      voxels;  // a ring of eight, each with a prong: every voxel of it has three neighbours
  for (int y = -1; y <= 1; ++y)
    for (int x = -1; x <= 1; ++x)
      if (x != 0 || y != 0) {
        voxels.push_back({5 + x, 5 + y, 5});
        voxels.push_back({5 + x, 5 + y, 6});
      }
  const SkeletonLabels s = label_skeleton(mask_of({11, 11, 11}, voxels));
  ASSERT_EQ(s.clusters.size(), 1U);
  EXPECT_EQ(s.clusters[0].cycles, 1);
}

TEST(SkeletonLabels, find_a_voxel_by_its_offset) {
  const SkeletonLabels s = label_skeleton(mask_of({9, 9, 9}, {{1, 1, 1}, {3, 2, 2}}));
  EXPECT_EQ(s.index_of(s.grid.offset({3, 2, 2})), 1);
  EXPECT_EQ(s.index_of(s.grid.offset({3, 2, 3})), -1);
}

}  // namespace
}  // namespace angiospline
