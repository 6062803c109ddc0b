#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

#include "io/meshes/part_arrays.h"
#include "modeling/network/tessellation.h"
#include "tests/shapes/sample_networks.h"

namespace angiospline {
namespace {

TriangleMesh tube() {
  return tessellate(samples::model_of(samples::tube_with_t_vertex()).network)->mesh;
}

TEST(PartArrays, HoldEveryTriangleOfTheMeshInItsPart) {
  const TriangleMesh mesh = tube();
  const std::vector<PartArrays> parts = arrays_of_parts(mesh);
  ASSERT_EQ(parts.size(), mesh.parts.size());
  std::vector<std::size_t> next(parts.size(), 0);
  for (int t = 0; t < mesh.triangles.cols(); ++t) {
    const auto p = static_cast<std::size_t>(mesh.part_of[static_cast<std::size_t>(t)]);
    for (int k = 0; k < 3; ++k) {
      ASSERT_LT(next[p], parts[p].indices.size());
      const std::uint32_t i = parts[p].indices[next[p]++];
      EXPECT_EQ(parts[p].points[i], mesh.triangles(k, t));
    }
  }
  for (std::size_t p = 0; p < parts.size(); ++p) EXPECT_EQ(next[p], parts[p].indices.size());
}

TEST(PartArrays, ListEachPointOfAPartOnceWithAUnitNormal) {
  const TriangleMesh mesh = tube();
  std::size_t listed = 0;
  for (const PartArrays& part : arrays_of_parts(mesh)) {
    std::vector<int> points = part.points;
    std::sort(points.begin(), points.end());
    EXPECT_EQ(std::adjacent_find(points.begin(), points.end()), points.end());
    ASSERT_EQ(part.normals.size(), part.points.size());
    for (const Vec3& n : part.normals) EXPECT_NEAR(n.norm(), 1, 1e-12);
    listed += points.size();
  }
  EXPECT_GT(listed, static_cast<std::size_t>(mesh.points_mm.cols())) << "rims belong to two parts";
}

TEST(PartArrays, ACapIsFlatUpToItsRimAndAWallIsNot) {
  const TriangleMesh mesh = tube();
  const std::vector<PartArrays> parts = arrays_of_parts(mesh);
  int caps = 0, walls = 0;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    if (parts[p].normals.empty()) continue;
    double spread = 0;
    for (const Vec3& n : parts[p].normals) {
      spread = std::max(spread, (n - parts[p].normals.front()).norm());
    }
    if (is_wall(mesh.parts[p].kind)) {
      EXPECT_GT(spread, 0.5);
      ++walls;
    } else {
      EXPECT_LT(spread, 1e-12);
      ++caps;
    }
  }
  EXPECT_EQ(caps, 2);
  EXPECT_GT(walls, 0);
}

TEST(PartArrays, APartWithoutTrianglesHasNone) {
  TriangleMesh mesh = tube();
  mesh.parts.push_back({"empty", PartKind::kCap, 0.0});
  EXPECT_TRUE(arrays_of_parts(mesh).back().points.empty());
}

}  // namespace
}  // namespace angiospline
