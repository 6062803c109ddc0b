// What is measured on meshes whose numbers are known.
#include <limits>

#include <gtest/gtest.h>

#include "kernel/geometry/triangle_mesh.h"

namespace angiospline {
namespace {

// The box from the origin to (a, b, c), wound outward.
TriangleMesh box(double a, double b, double c, const Vec3& shift = Vec3::Zero()) {
  TriangleMesh mesh;
  mesh.points_mm.resize(3, 8);
  for (int k = 0; k < 8; ++k)
    mesh.points_mm.col(k) = shift + Vec3(k & 1 ? a : 0, k & 2 ? b : 0, k & 4 ? c : 0);
  const int quads[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                           {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  mesh.triangles.resize(3, 12);
  for (int q = 0; q < 6; ++q) {
    mesh.triangles.col(2 * q) << quads[q][0], quads[q][1], quads[q][2];
    mesh.triangles.col(2 * q + 1) << quads[q][0], quads[q][2], quads[q][3];
  }
  mesh.parts = {{"wall", PartKind::kBody, 0}, {"cap", PartKind::kCap, 0}};
  mesh.part_of.assign(12, 0);
  mesh.part_of[0] = mesh.part_of[1] = 1;
  return mesh;
}

TriangleMesh both(const TriangleMesh& a, const TriangleMesh& b) {
  TriangleMesh mesh = a;
  mesh.points_mm.conservativeResize(3, a.points_mm.cols() + b.points_mm.cols());
  mesh.points_mm.rightCols(b.points_mm.cols()) = b.points_mm;
  mesh.triangles.conservativeResize(3, a.triangles.cols() + b.triangles.cols());
  mesh.triangles.rightCols(b.triangles.cols()) =
      b.triangles.array() + static_cast<int>(a.points_mm.cols());
  mesh.part_of.insert(mesh.part_of.end(), b.part_of.begin(), b.part_of.end());
  return mesh;
}

TEST(MeshMeasure, OfABoxIsItsVolumeAreaAndGenus) {
  const MeshMeasure m = measure(box(2, 3, 4, Vec3(1e6, 0, -1e6)));  // far from the origin
  EXPECT_NEAR(m.volume_mm3, 24, 1e-6);
  EXPECT_NEAR(m.area_mm2, 52, 1e-6);
  EXPECT_NEAR(m.part_area_mm2[1], 6, 1e-6);
  EXPECT_TRUE(m.closed());
  EXPECT_EQ(m.components, 1);
  EXPECT_EQ(m.genus, std::vector<int>{0});
  EXPECT_EQ(m.lowest_mm, Vec3(1e6, 0, -1e6));
}

TEST(MeshMeasure, WoundInwardAVolumeIsNegative) {
  TriangleMesh mesh = box(2, 3, 4);
  mesh.triangles.row(0).swap(mesh.triangles.row(1));
  EXPECT_NEAR(measure(mesh).volume_mm3, -24, 1e-12);
  EXPECT_TRUE(measure(mesh).closed());
}

TEST(MeshMeasure, OfATorusIsGenusOne) {
  constexpr int kRing = 12, kTube = 7;
  TriangleMesh mesh;
  mesh.points_mm = Points3::Random(3, kRing * kTube);
  mesh.triangles.resize(3, 2 * kRing * kTube);
  for (int r = 0; r < kRing; ++r) {
    for (int t = 0; t < kTube; ++t) {
      const auto at = [&](int i, int j) { return (r + i) % kRing * kTube + (t + j) % kTube; };
      mesh.triangles.col(2 * (r * kTube + t)) << at(0, 0), at(1, 0), at(1, 1);
      mesh.triangles.col(2 * (r * kTube + t) + 1) << at(0, 0), at(1, 1), at(0, 1);
    }
  }
  mesh.parts = {{"ring", PartKind::kBody, 0}};
  mesh.part_of.assign(static_cast<std::size_t>(mesh.triangles.cols()), 0);
  const MeshMeasure m = measure(mesh);
  ASSERT_TRUE(m.closed());
  EXPECT_EQ(m.genus, std::vector<int>{1});
}

TEST(MeshMeasure, FindsOpenEdgesEdgesThatDisagreeAndPointsWhereFansMeet) {
  TriangleMesh open = box(1, 1, 1);
  open.triangles.conservativeResize(3, 11);
  open.part_of.resize(11);
  EXPECT_EQ(measure(open).open_edges, 3);
  EXPECT_TRUE(measure(open).genus.empty());

  TriangleMesh turned = box(1, 1, 1);
  std::swap(turned.triangles(0, 5), turned.triangles(1, 5));
  EXPECT_EQ(measure(turned).bad_edges, 3);

  // Two boxes that share a corner point.
  TriangleMesh touching = both(box(1, 1, 1), box(1, 1, 1, Vec3(1, 1, 1)));
  for (int& p : touching.triangles.reshaped())
    if (p == 8) p = 7;
  const MeshMeasure m = measure(touching);
  EXPECT_EQ(m.bad_points, 1);
  EXPECT_EQ(m.open_edges + m.bad_edges, 0);
  EXPECT_FALSE(m.closed());
}

TEST(ComponentsOfTriangles, AreNumberedByTheLowestTriangle) {
  TriangleMesh two = both(box(1, 1, 1), box(2, 2, 2, Vec3(5, 0, 0)));
  // The last box's triangles come first; the numbers follow the triangles, not the points.
  const Eigen::Matrix3Xi first = two.triangles.leftCols(12);
  two.triangles.leftCols(12) = two.triangles.rightCols(12).eval();
  two.triangles.rightCols(12) = first;
  std::vector<int> expected(12, 0);
  expected.insert(expected.end(), 12, 1);
  EXPECT_EQ(components_of_triangles(two), expected);
  EXPECT_EQ(measure(two).genus, (std::vector<int>{0, 0}));
}

TEST(MeshMeasure, OfNothingIsZero) {
  const MeshMeasure m = measure(TriangleMesh{});
  EXPECT_EQ(m.volume_mm3, 0);
  EXPECT_EQ(m.components, 0);
}

TEST(FindDefect, NamesWhatIsBroken) {
  EXPECT_FALSE(find_defect(box(1, 1, 1)));
  TriangleMesh mesh = box(1, 1, 1);
  mesh.triangles(2, 7) = 8;
  ASSERT_TRUE(find_defect(mesh));
  EXPECT_EQ(find_defect(mesh)->where, "triangle 7");
  mesh = box(1, 1, 1);
  mesh.part_of[3] = 2;
  EXPECT_EQ(find_defect(mesh)->where, "triangle 3");
  mesh.part_of.pop_back();
  EXPECT_EQ(find_defect(mesh)->what, "wrong number of part indices");
  mesh = box(1, 1, 1);
  mesh.points_mm(1, 4) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(find_defect(mesh)->where, "point 4");
  mesh = box(1, 1, 1);
  mesh.normals = Points3::Zero(3, 5);
  EXPECT_EQ(find_defect(mesh)->what, "wrong number of normals");
}

TEST(PartKind, IsToldByTheBeginningOfAName) {
  EXPECT_EQ(part_kind_of_name("junction 3"), PartKind::kJunction);
  EXPECT_EQ(part_kind_of_name("outlet_left"), PartKind::kOutlet);
  EXPECT_EQ(part_kind_of_name("aorta"), PartKind::kBody);
  for (const PartKind kind :
       {PartKind::kJunction, PartKind::kInlet, PartKind::kOutlet, PartKind::kCap}) {
    EXPECT_EQ(part_kind_of_name(to_string(kind)), kind);
    EXPECT_EQ(is_wall(kind), kind == PartKind::kJunction);
  }
}

}  // namespace
}  // namespace angiospline
