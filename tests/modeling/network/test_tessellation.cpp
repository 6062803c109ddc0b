#include <cmath>
#include <numbers>
#include <sstream>
#include <string>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "modeling/network/tessellation.h"
#include "tests/shapes/sample_networks.h"

namespace angiospline {
namespace {

struct Case {
  const char* name;
  SurfaceNetwork network;
  int genus;
};

std::vector<Case> cases() {
  SurfaceNetwork two = samples::tube();
  append(two, samples::torus());
  return {{"tube", samples::tube(), 0},
          {"short tube", samples::tube(1, 0.01), 0},
          {"long tube", samples::tube(0.1, 50, 30), 0},
          {"T-vertex", samples::tube_with_t_vertex(), 0},
          {"bent", samples::bent_tube(), 0},
          {"torus", samples::torus(), 1}};
}

TEST(SampleNetworks, AreSoundAndClosedByJoinsThatAreTheSameCurve) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    const auto defect = find_defect(c.network);
    EXPECT_FALSE(defect) << defect->message();
    for (const Join& join : c.network.joins) {
      for (const double s : {0.0, 0.3, 1.0}) {
        const auto& patches = c.network.patches;
        const Vec2 a = side_parameters(patches[static_cast<std::size_t>(join.a.patch)], join.a.side,
                                       join_parameter_a(join, s));
        const Vec2 b = side_parameters(patches[static_cast<std::size_t>(join.b.patch)], join.b.side,
                                       join_parameter_b(join, s));
        EXPECT_LT((patch_surface(c.network, join.a.patch).at(a.x(), a.y()) -
                   patch_surface(c.network, join.b.patch).at(b.x(), b.y()))
                      .norm(),
                  1e-13);
      }
    }
  }
}

TEST(Tessellate, IsClosedOrientedOutwardAndOfTheRightGenus) {
  for (const Case& c : cases()) {
    for (const double tolerance : {0.3, 0.02, 0.002}) {
      SCOPED_TRACE(std::string(c.name) + " at " + std::to_string(tolerance));
      const auto t = tessellate(c.network, {.chord_tolerance = tolerance});
      ASSERT_TRUE(t) << t.error().message();
      EXPECT_FALSE(find_defect(t->mesh));
      const MeshMeasure m = measure(t->mesh);
      EXPECT_EQ(m.open_edges, 0);
      EXPECT_EQ(m.bad_edges, 0);
      EXPECT_EQ(m.bad_points, 0);
      EXPECT_EQ(m.components, 1);
      EXPECT_EQ(m.genus, std::vector<int>{c.genus});
      EXPECT_GT(m.volume_mm3, 0);
    }
  }
}

TEST(Tessellate, VolumeAndAreaConvergeToTheExactOnes) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    const double exact = samples::exact_volume_mm3(c.network);
    double last = 1e9;
    for (const double tolerance : {0.04, 0.01, 0.0025}) {
      const auto t = tessellate(c.network, {.chord_tolerance = tolerance, .longest_edge = 3});
      ASSERT_TRUE(t);
      const MeshMeasure m = measure(t->mesh);
      const double error = std::abs(m.volume_mm3 - exact) / exact;
      EXPECT_LT(error, 2.5 * tolerance);
      EXPECT_LT(error, 0.4 * last);  // a quarter is what the order predicts
      last = error;
    }
  }
  const double tube = samples::exact_volume_mm3(samples::tube(2, 3));
  EXPECT_NEAR(tube, std::numbers::pi * 4 * 3, 1e-4);
}

TEST(Tessellate, KeepsTheChordTolerance) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    constexpr double kTolerance = 0.01;
    const auto t = tessellate(c.network, {.chord_tolerance = kTolerance});
    ASSERT_TRUE(t);
    double worst = 0;
    int checked = 0;
    for (int k = 0; k < t->mesh.triangles.cols(); ++k) {
      const auto corner = t->mesh.triangles.col(k);
      const PatchPoint& a = t->origins[static_cast<std::size_t>(corner[0])];
      const PatchPoint& b = t->origins[static_cast<std::size_t>(corner[1])];
      const PatchPoint& d = t->origins[static_cast<std::size_t>(corner[2])];
      if (a.patch < 0 || a.patch != b.patch || a.patch != d.patch) continue;
      ++checked;
      const Vec2 uv = (a.uv + b.uv + d.uv) / 3;
      const Vec3 on_surface = patch_surface(c.network, a.patch).at(uv.x(), uv.y());
      const Vec3 p = t->mesh.points_mm.col(corner[0]);
      const Vec3 n = (Vec3(t->mesh.points_mm.col(corner[1])) - p)
                         .cross(Vec3(t->mesh.points_mm.col(corner[2])) - p)
                         .normalized();
      worst = std::max(worst, std::abs(n.dot(on_surface - p)));
    }
    EXPECT_GT(checked, 50);
    const double radius = c.network.regions[0].radius_mm;
    EXPECT_LT(worst, kTolerance * radius);
    EXPECT_GT(worst, 0.1 * kTolerance * radius);  // and is not wasteful
  }
}

TEST(Tessellate, PointsLieOnTheSurfaceWithItsNormals) {
  const SurfaceNetwork network = samples::bent_tube();
  const auto t = tessellate(network);
  ASSERT_TRUE(t);
  for (std::size_t k = 0; k < t->origins.size(); ++k) {
    const PatchPoint& o = t->origins[k];
    if (o.patch < 0) continue;
    const BSplineSurface<3> surface = patch_surface(network, o.patch);
    const auto column = static_cast<Eigen::Index>(k);
    EXPECT_LT((surface.at(o.uv.x(), o.uv.y()) - t->mesh.points_mm.col(column)).norm(), 1e-12);
    // The two halves of this tube meet with equal tangent planes to the accuracy of the quintic.
    EXPECT_GT(
        normal_vector(surface, o.uv.x(), o.uv.y()).normalized().dot(t->mesh.normals.col(column)),
        0.9999);
  }
}

TEST(Tessellate, PartsAreRegionsThenRimsAndEveryPartHasTriangles) {
  const auto t = tessellate(samples::tube_with_t_vertex());
  ASSERT_TRUE(t);
  std::vector<std::string> names;
  for (const MeshPart& part : t->mesh.parts) names.push_back(part.name);
  EXPECT_EQ(names, (std::vector<std::string>{"wall_a", "wall_b", "inlet", "outlet_end"}));
  EXPECT_EQ(t->mesh.parts[2].kind, PartKind::kInlet);
  const MeshMeasure m = measure(t->mesh);
  EXPECT_NEAR(m.part_area_mm2[0], 2 * std::numbers::pi * 2, 0.1);
  EXPECT_NEAR(m.part_area_mm2[1], 2 * std::numbers::pi * 3, 0.1);
  EXPECT_NEAR(m.part_area_mm2[2], std::numbers::pi, 0.05);
  EXPECT_NEAR(m.part_area_mm2[3], std::numbers::pi, 0.05);
}

TEST(Tessellate, DoesNotDependOnScale) {
  const SurfaceNetwork network = samples::bent_tube();
  SurfaceNetwork small = network;
  small.control_points_mm *= 0x1p-20;
  for (Region& region : small.regions) region.radius_mm *= 0x1p-20;
  for (Rim& rim : small.rims) {
    rim.center_mm *= 0x1p-20;
    rim.radius_mm *= 0x1p-20;
  }
  const auto a = tessellate(network);
  const auto b = tessellate(small);
  ASSERT_TRUE(a && b);
  EXPECT_EQ(a->mesh.triangles, b->mesh.triangles);
  EXPECT_EQ(a->mesh.points_mm * 0x1p-20, b->mesh.points_mm);
}

TEST(Tessellate, RefusesWhatIsBrokenOrTooFineOrStopped) {
  SurfaceNetwork open = samples::tube();
  open.rims.pop_back();
  EXPECT_FALSE(tessellate(open));
  SurfaceNetwork not_finite = samples::tube();
  not_finite.control_points_mm(1, 7) = std::nan("");
  ASSERT_FALSE(tessellate(not_finite));
  EXPECT_EQ(tessellate(not_finite).error().where, "control point 7");
  EXPECT_FALSE(tessellate(samples::tube(), {.chord_tolerance = 1e-14}));
  const Progress stop{{}, [] { return true; }};
  ASSERT_FALSE(tessellate(samples::tube(), {}, stop));
  EXPECT_EQ(tessellate(samples::tube(), {}, stop).error().kind, ErrorKind::kCancelled);
}

TEST(Tessellate, CoarsensByNoMoreThanItMustWhereItMay) {
  const SurfaceNetwork network = samples::bent_tube();
  const auto fine = tessellate(network, {.chord_tolerance = 1e-4});
  ASSERT_TRUE(fine);
  const auto triangles = static_cast<double>(fine->mesh.triangles.cols());
  EXPECT_EQ(fine->used.chord_tolerance, 1e-4);
  TessellationOptions options{
      .chord_tolerance = 1e-4, .most_triangles = triangles / 10, .coarsen = true};
  const auto coarse = tessellate(network, options);
  ASSERT_TRUE(coarse) << coarse.error().message();
  EXPECT_TRUE(measure(coarse->mesh).closed());
  EXPECT_LE(static_cast<double>(coarse->mesh.triangles.cols()), options.most_triangles);
  EXPECT_GE(static_cast<double>(coarse->mesh.triangles.cols()), 0.7 * options.most_triangles);
  EXPECT_GT(coarse->used.chord_tolerance, 8e-4);
  EXPECT_LT(coarse->used.chord_tolerance, 2e-3);

  // The same as an error names the tolerance that fits, and it does.
  options.coarsen = false;
  const auto refused = tessellate(network, options);
  ASSERT_FALSE(refused);
  std::ostringstream tolerance;
  tolerance << "a tolerance of " << coarse->used.chord_tolerance << " local radii";
  EXPECT_NE(refused.error().rule.find(tolerance.str()), std::string::npos) << refused.error().rule;
  options.chord_tolerance = coarse->used.chord_tolerance;
  options.longest_edge = coarse->used.longest_edge;
  EXPECT_TRUE(tessellate(network, options));

  // No tolerance makes so few.
  const auto never = tessellate(network, {.most_triangles = 10, .coarsen = true});
  ASSERT_FALSE(never);
  EXPECT_EQ(never.error().rule, "at most 10");
}

TEST(Measure, SeesHolesFlipsAndPinchedPoints) {
  auto t = tessellate(samples::tube());
  ASSERT_TRUE(t);
  TriangleMesh hole = t->mesh;
  hole.triangles.conservativeResize(3, hole.triangles.cols() - 1);
  hole.part_of.pop_back();
  EXPECT_EQ(measure(hole).open_edges, 3);
  TriangleMesh flipped = t->mesh;
  std::swap(flipped.triangles(0, 5), flipped.triangles(1, 5));
  EXPECT_EQ(measure(flipped).bad_edges, 3);
  TriangleMesh pinched = t->mesh;  // two closed surfaces that share one point
  const Eigen::Index points = pinched.points_mm.cols();
  const Eigen::Index triangles = pinched.triangles.cols();
  pinched.points_mm.conservativeResize(3, 2 * points);
  pinched.points_mm.rightCols(points) = t->mesh.points_mm;
  pinched.triangles.conservativeResize(3, 2 * triangles);
  pinched.triangles.rightCols(triangles) = t->mesh.triangles.array() + static_cast<int>(points);
  pinched.part_of.insert(pinched.part_of.end(), t->mesh.part_of.begin(), t->mesh.part_of.end());
  EXPECT_EQ(measure(pinched).components, 2);
  EXPECT_EQ(measure(pinched).bad_points, 0);
  pinched.triangles =
      (pinched.triangles.array() == static_cast<int>(points)).select(0, pinched.triangles);
  EXPECT_EQ(measure(pinched).bad_points, 1);
  EXPECT_FALSE(measure(pinched).closed());
}

}  // namespace
}  // namespace angiospline
