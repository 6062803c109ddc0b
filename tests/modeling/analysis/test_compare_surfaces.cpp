#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "base/random.h"
#include "kernel/geometry/triangle_tree.h"
#include "modeling/analysis/compare_surfaces.h"
#include "modeling/network/tessellation.h"
#include "tests/shapes/sample_networks.h"

namespace angiospline {
namespace {

TriangleMesh mesh_of(const SurfaceNetwork& network, double tolerance = 0.01) {
  auto t = tessellate(network, {.chord_tolerance = tolerance});
  EXPECT_TRUE(t);
  return t->mesh;
}

Vec3 random_point(Random& random, double size) {
  return {random.uniform(-size, size), random.uniform(-size, size), random.uniform(-size, size)};
}

// Nothing of the triangle, sampled densely, is nearer than the answer, and the answer lies in it.
TEST(NearestOnTriangle, IsNotBeatenBySamplesAndLiesInTheTriangle) {
  Random random(3);
  for (int round = 0; round < 300; ++round) {
    const Vec3 a = random_point(random, 1);
    Vec3 b = random_point(random, 1);
    Vec3 c = random_point(random, 1);
    if (round % 5 == 0) c = a + 0.3 * (b - a);  // a segment
    if (round % 7 == 0) b = c = a;              // a point
    const Vec3 p = random_point(random, 2);
    const Vec3 q = nearest_on_triangle(p, a, b, c);
    constexpr int kSteps = 20;
    double sampled = 1e9;
    for (int i = 0; i <= kSteps; ++i) {
      for (int j = 0; i + j <= kSteps; ++j) {
        const Vec3 s = a + (b - a) * i / kSteps + (c - a) * j / kSteps;
        sampled = std::min(sampled, (s - p).norm());
      }
    }
    EXPECT_LE((q - p).norm(), sampled + 1e-12);
    EXPECT_LT((nearest_on_triangle(q, a, b, c) - q).norm(), 1e-7);
    EXPECT_GT((q - p).norm(), sampled - 0.2);
  }
}

TEST(TriangleTree, AgreesWithBruteForce) {
  const TriangleMesh mesh = mesh_of(samples::bent_tube(), 0.1);
  const TriangleTree tree(mesh);
  Random random(5);
  for (int round = 0; round < 200; ++round) {
    const Vec3 p = random_point(random, round % 2 == 0 ? 15 : 3);
    double brute = 1e300;
    for (const auto& t : mesh.triangles.colwise()) {
      const Vec3 q = nearest_on_triangle(p, mesh.points_mm.col(t[0]), mesh.points_mm.col(t[1]),
                                         mesh.points_mm.col(t[2]));
      brute = std::min(brute, (q - p).squaredNorm());
    }
    EXPECT_EQ(tree.nearest(p).squared_distance_mm2, brute);
    EXPECT_EQ(tree.nearest(p, round).squared_distance_mm2, brute);
  }
}

TEST(Compare, ASurfaceEqualsItself) {
  const TriangleMesh mesh = mesh_of(samples::bent_tube());
  const auto c = compare(mesh, mesh);
  ASSERT_TRUE(c);
  EXPECT_LT(c->max_distance_mm, 1e-14);
  EXPECT_EQ(c->volume_ratio, 1);
  EXPECT_EQ(c->area_ratio, 1);
  EXPECT_TRUE(c->same_topology);
}

TEST(Compare, ConcentricTubesAreAsFarApartAsTheirRadii) {
  const TriangleMesh thin = mesh_of(samples::tube(1.0, 20), 0.0005);
  const TriangleMesh wide = mesh_of(samples::tube(1.1, 20), 0.0005);
  const auto c = compare(thin, wide, {.spacing_mm = 0.2});
  ASSERT_TRUE(c);
  EXPECT_NEAR(c->a_to_b.max_mm, 0.1, 1e-3);  // the caps lie in each other's planes
  EXPECT_NEAR(c->b_to_a.max_mm, 0.1, 1e-3);
  // Walls are 0.1 apart; of the wide caps only the ring between the radii is away, 0.05 on average.
  const double wall = 2 * std::numbers::pi * 20;
  const double cap = 2 * std::numbers::pi;
  EXPECT_NEAR(c->a_to_b.mean_mm, 0.1 * wall / (wall + cap), 1e-3);
  EXPECT_NEAR(c->a_to_b.rms_mm, 0.1 * std::sqrt(wall / (wall + cap)), 1e-3);
  EXPECT_NEAR(c->volume_ratio, 1.21, 1e-4);
  EXPECT_TRUE(c->same_topology);
}

TEST(Compare, SeesADentThatOnlyOneWayShows) {
  // A long tube against its first half: far only from the long one.
  const auto c = compare(mesh_of(samples::tube(1, 10)), mesh_of(samples::tube(1, 5)));
  ASSERT_TRUE(c);
  EXPECT_NEAR(c->a_to_b.max_mm, 5, 0.01);
  EXPECT_LT(c->b_to_a.max_mm,
            1.01);  // the middle of the short one's cap is one radius off the wall
  EXPECT_EQ(c->max_distance_mm, c->a_to_b.max_mm);
  EXPECT_NEAR(c->a_to_b.worst_mm.z(), 10, 1e-9);
}

TEST(Compare, SamplesBetweenTheCornersOfLargeTriangles) {
  TriangleMesh flat;
  flat.points_mm.resize(3, 3);
  flat.points_mm << 0, 10, 0, 0, 0, 10, 0, 0, 0;
  flat.triangles.resize(3, 1);
  flat.triangles << 0, 1, 2;
  flat.part_of = {0};
  flat.parts = {{"a", PartKind::kBody, 0}};
  TriangleMesh tent = flat;  // the same corners, and a peak over the middle
  tent.points_mm.conservativeResize(3, 4);
  tent.points_mm.col(3) << 3, 3, 1;
  tent.triangles.resize(3, 3);
  tent.triangles << 0, 1, 2, 1, 2, 0, 3, 3, 3;
  tent.part_of = {0, 0, 0};
  const auto c = compare(flat, tent, {.spacing_mm = 0.1});
  ASSERT_TRUE(c);
  EXPECT_GT(c->a_to_b.max_mm, 0.8);
  EXPECT_NEAR(c->b_to_a.max_mm, 1, 1e-12);
}

TEST(Compare, TellsGenusComponentsOpeningsAndCapsApart) {
  const TriangleMesh tube = mesh_of(samples::tube());
  const auto same = [](const TriangleMesh& a, const TriangleMesh& b) {
    const auto c = compare(a, b, {.spacing_mm = 10});
    EXPECT_TRUE(c);
    return c->same_topology;
  };
  EXPECT_TRUE(same(tube, mesh_of(samples::bent_tube())));
  EXPECT_FALSE(same(tube, mesh_of(samples::torus())));
  SurfaceNetwork two = samples::tube();
  append(two, samples::bent_tube());
  EXPECT_FALSE(same(tube, mesh_of(two)));
  SurfaceNetwork other = samples::tube();
  other.rims[1].kind = RimKind::kCap;
  EXPECT_FALSE(same(tube, mesh_of(other)));
  TriangleMesh open = tube;  // without its last part, a cap
  Eigen::Index kept = 0;
  while (open.part_of[static_cast<std::size_t>(kept)] < 3 && kept + 1 < open.triangles.cols())
    ++kept;
  open.triangles.conservativeResize(3, kept);
  open.part_of.resize(static_cast<std::size_t>(kept));
  EXPECT_FALSE(same(tube, open));
  EXPECT_TRUE(same(open, open));
}

TEST(Compare, RefusesNothingAndStops) {
  const TriangleMesh tube = mesh_of(samples::tube());
  EXPECT_FALSE(compare(tube, TriangleMesh{}));
  const Progress stop{{}, [] { return true; }};
  ASSERT_FALSE(compare(tube, tube, {}, stop));
  EXPECT_EQ(compare(tube, tube, {}, stop).error().kind, ErrorKind::kCancelled);
}

TEST(DistanceField, IsSignedOutward) {
  const TriangleMesh thin = mesh_of(samples::tube(1.0, 20), 0.001);
  const TriangleMesh wide = mesh_of(samples::tube(1.1, 20), 0.001);
  const MeshField out = distance_field(wide, thin);
  const MeshField in = distance_field(thin, wide);
  int walls = 0;
  for (Eigen::Index k = 0; k < wide.points_mm.cols(); ++k) {
    if (wide.points_mm(2, k) < 2 || wide.points_mm(2, k) > 18) continue;
    ++walls;
    EXPECT_NEAR(out.values[k], 0.1, 2e-3);
  }
  EXPECT_GT(walls, 100);
  for (Eigen::Index k = 0; k < thin.points_mm.cols(); ++k) {
    if (thin.points_mm(2, k) < 2 || thin.points_mm(2, k) > 18) continue;
    EXPECT_NEAR(in.values[k], -0.1, 2e-3);
  }
}

}  // namespace
}  // namespace angiospline
