#include <algorithm>
#include <cstdlib>
#include <set>
#include <string>

#include <gtest/gtest.h>

#include "io/cad/order_patches.h"
#include "io/cad/split_joins.h"
#include "io/cad/turn_patches.h"
#include "modeling/build/build_model.h"
#include "modeling/check/certificate.h"
#include "modeling/solid/solid.h"
#include "modeling/tree/point_graph.h"
#include "tests/shapes/crafted_networks.h"
#include "tests/shapes/sample_networks.h"

namespace angiospline {
namespace {

std::vector<SurfaceNetwork> networks() {
  return {samples::tube(), samples::tube_with_t_vertex(), samples::torus(), samples::bent_tube(),
          crafted::tube_of_quarters(1, 6)};
}

TEST(SplitJoins, KeepsTheLawsOfANetworkAndTouchesNoPatch) {
  for (const SurfaceNetwork& whole : networks()) {
    const SurfaceNetwork split = split_joins(whole);
    const auto defect = find_defect(split);
    EXPECT_FALSE(defect) << defect->message();
    EXPECT_GT(split.joins.size(), whole.joins.size());
    EXPECT_EQ(split.patches.size(), whole.patches.size());
    EXPECT_EQ(split.control_points_mm, whole.control_points_mm);
    EXPECT_EQ(split.rims.size(), whole.rims.size());
  }
}

TEST(SplitJoins, GivesTheSameClosedSolidWithTheSameFaces) {
  for (const SurfaceNetwork& whole : networks()) {
    const auto one = make_solid(whole);
    const auto other = make_solid(split_joins(whole));
    ASSERT_TRUE(one);
    ASSERT_TRUE(other) << other.error().message();
    const auto a = certify(*one);
    const auto b = certify(*other);
    ASSERT_TRUE(a && b);
    EXPECT_TRUE(b->closed && b->valid);
    EXPECT_EQ(a->genus, b->genus);
    EXPECT_NEAR(a->volume_mm3, b->volume_mm3, 1e-9 * a->volume_mm3);
    EXPECT_LT(b->max_gap_mm, 1e-12);
    EXPECT_NEAR(a->max_normal_angle_deg, b->max_normal_angle_deg, 1e-6);
    ASSERT_EQ(one->faces.size(), other->faces.size());
    for (std::size_t k = 0; k < one->faces.size(); ++k) {
      EXPECT_EQ(one->faces[k].name, other->faces[k].name);
    }
  }
}

TEST(TurnLongPatches, KeepsThePointsTheLawsAndTheSolid) {
  for (const SurfaceNetwork& network : networks()) {
    const SurfaceNetwork turned = turn_long_patches(network);
    const auto defect = find_defect(turned);
    EXPECT_FALSE(defect) << defect->message();
    EXPECT_EQ(turned.control_points_mm, network.control_points_mm);
    for (std::size_t k = 0; k < network.patches.size(); ++k) {
      const auto before = patch_surface(network, static_cast<int>(k));
      const auto after = patch_surface(turned, static_cast<int>(k));
      EXPECT_LE(turned.patches[k].u.breakpoints().size(), turned.patches[k].v.breakpoints().size());
      if (turned.patches[k].u.knots() == network.patches[k].u.knots()) continue;
      const double u = 0.7 * before.u().first() + 0.3 * before.u().last();
      const double v = 0.4 * before.v().first() + 0.6 * before.v().last();
      const Vec3 there = after.at(v, before.u().first() + before.u().last() - u);
      EXPECT_LT((there - before.at(u, v)).norm(), 1e-12 * (1 + there.norm()));
    }
    const auto one = make_solid(network), other = make_solid(turned);
    ASSERT_TRUE(one);
    ASSERT_TRUE(other) << other.error().message();
    const auto a = certify(*one), b = certify(*other);
    ASSERT_TRUE(a && b);
    EXPECT_TRUE(b->closed && b->valid);
    EXPECT_EQ(a->genus, b->genus);
    EXPECT_NEAR(a->volume_mm3, b->volume_mm3, 1e-9 * a->volume_mm3);
    EXPECT_NEAR(a->max_normal_angle_deg, b->max_normal_angle_deg, 1e-6);
  }
}

// Half a circle of radius 1 turns by 180 degrees and is 2 wide; the tube is 10 long.
TEST(SplitJoins, CutsATubesSeamsByItsWidthAndItsCirclesByTheirTurn) {
  const SurfaceNetwork split = split_joins(samples::tube(1.0, 10.0), {1.0, 95.0});
  for (const Rim& rim : split.rims) EXPECT_EQ(rim.sides.size(), 4U);
  EXPECT_EQ(split.joins.size(), 10U);  // two seams of five pieces
  const SurfaceNetwork coarse = split_joins(samples::tube(1.0, 10.0), {6.0, 200.0});
  EXPECT_EQ(coarse.joins.size(), 2U);
  for (const Rim& rim : coarse.rims) EXPECT_EQ(rim.sides.size(), 2U);
}

TEST(SplitJoins, DoesNotDependOnScale) {
  const SurfaceNetwork small = split_joins(samples::tube(1e-3, 5e-3));
  const SurfaceNetwork large = split_joins(samples::tube(1e3, 5e3));
  ASSERT_EQ(small.joins.size(), large.joins.size());
  for (std::size_t k = 0; k < small.joins.size(); ++k) {
    EXPECT_NEAR(small.joins[k].a.to, large.joins[k].a.to, 1e-9);
  }
}

TEST(OrderByNeighbours, KeepsTheLawsAndTheSolid) {
  for (const SurfaceNetwork& network : networks()) {
    const SurfaceNetwork ordered = order_by_neighbours(network);
    const auto defect = find_defect(ordered);
    EXPECT_FALSE(defect) << defect->message();
    EXPECT_EQ(ordered.patches.size(), network.patches.size());
    const auto a = certify(network);
    const auto b = certify(ordered);
    ASSERT_TRUE(a && b);
    EXPECT_TRUE(b->closed && b->valid);
    EXPECT_EQ(a->genus, b->genus);
    EXPECT_NEAR(a->volume_mm3, b->volume_mm3, 1e-12 * a->volume_mm3);
  }
}

// A trunk with a twig at every ten radii.
SurfaceNetwork comb(int twigs) {
  PointGraph graph;
  const auto add = [&](const Vec3& at, double radius, int after) {
    const int id = static_cast<int>(graph.points.size());
    graph.points.push_back({std::to_string(id), at, radius});
    if (after >= 0) graph.edges.emplace_back(after, id);
    return id;
  };
  int trunk = add(Vec3::Zero(), 1.0, -1);
  for (int k = 0; k < twigs; ++k) {
    trunk = add(Vec3(0, 0, 10 * (k + 0.5)), 1.0, trunk);
    trunk = add(Vec3(0, 0, 10 * (k + 1.0)), 1.0, trunk);
    const int twig = add(Vec3(5, 0, 10 * (k + 1.0) + 2), 0.6, trunk);
    add(Vec3(9, 0, 10 * (k + 1.0) + 3), 0.6, twig);
  }
  add(Vec3(0, 0, 10 * (twigs + 1.0)), 1.0, trunk);
  return build_model(tree_from_points(graph).value()).value().network;
}

TEST(OrderByNeighbours, PutsNeighboursNearEachOther) {
  const auto longest_jump = [](const SurfaceNetwork& network) {
    int longest = 0;
    for (const Join& join : network.joins) {
      longest = std::max(longest, std::abs(join.a.patch - join.b.patch));
    }
    return longest;
  };
  const SurfaceNetwork given = comb(20);
  const SurfaceNetwork ordered = order_by_neighbours(given);
  EXPECT_GT(longest_jump(given), 100);   // all junctions stand before all bodies
  EXPECT_LT(longest_jump(ordered), 20);  // a junction, its twig and its trunk
  EXPECT_FALSE(find_defect(ordered));
  for (std::size_t r = 1; r < ordered.rims.size(); ++r) {
    EXPECT_LT(ordered.rims[r - 1].sides[0].patch, ordered.rims[r].sides[0].patch);
  }
  std::multiset<std::string> before, after;
  for (const Patch& p : given.patches) {
    before.insert(given.regions[static_cast<std::size_t>(p.region)].name);
  }
  for (const Patch& p : ordered.patches) {
    after.insert(ordered.regions[static_cast<std::size_t>(p.region)].name);
  }
  EXPECT_EQ(before, after);
}

}  // namespace
}  // namespace angiospline
