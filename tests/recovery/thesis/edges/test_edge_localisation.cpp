#include <cmath>

#include <gtest/gtest.h>

#include "recovery/imaging/rasterize/shapes.h"
#include "recovery/thesis/edges/edge_localisation.h"
#include "recovery/thesis/edges/edge_masks.h"

namespace angiospline {
namespace {

ImageGrid cube(int edge, const Vec3& spacing = Vec3::Ones()) {
  ImageGrid grid;
  grid.size = {edge, edge, edge};
  grid.spacing_mm = spacing;
  return grid;
}

bool near_border(const Vec3& p, const ImageGrid& grid) {
  const Vec3 v = grid.index_vox(p);
  for (int i = 0; i < 3; ++i)
    if (v[i] < 5 || v[i] > grid.size[static_cast<std::size_t>(i)] - 6) return true;
  return false;
}

struct Bias {
  double raw = 0, corrected = 0;
  int count = 0;
};

// Mean offset from a round cone without ends: a cylinder, or a ball where a == b.
Bias bias_on(const ImageGrid& grid, const Vec3& centre, const Vec3& axis, double radius) {
  const Image<float> filled =
      coverage(grid, {round_cone(centre - 50 * axis, radius, centre + 50 * axis, radius)});
  const auto field = find_edges(filled, {EdgeContrast{0.4}, EdgeThinning::kAcross});
  EXPECT_TRUE(field);
  const auto raw = localise_edges(filled, *field, EdgeCorrection::kNone);
  const auto corrected = localise_edges(filled, *field);
  const auto offset = [&](const EdgePlace& e) {
    const Vec3 d = e.point_mm - centre;
    return (d - d.dot(axis) * axis).norm() - radius;
  };
  Bias bias;
  for (std::size_t i = 0; i < raw.size(); ++i) {
    if (near_border(raw[i].point_mm, grid)) continue;
    EXPECT_TRUE(corrected[i].corrected);
    EXPECT_FALSE(raw[i].corrected);
    bias.raw += offset(raw[i]);
    bias.corrected += offset(corrected[i]);
    ++bias.count;
  }
  bias.raw /= bias.count;
  bias.corrected /= bias.count;
  return bias;
}

TEST(EdgeLocalisation, PlanesHaveNoBias) {
  const auto directions = edge_directions(false);
  int seen = 0;
  for (std::size_t d = 0; d < directions.size(); d += 3) {
    const Vec3& n = directions[d];
    const ImageGrid grid = cube(15);
    double sum[2] = {};
    int count = 0;
    // The peak between voxels is drawn to them a little: both ways alike.
    for (const double shift : {-0.23, 0.23}) {
      const Vec3 centre = Vec3::Constant(7.0) + shift * n;
      Image<float> image(grid);
      for (std::size_t i = 0; i < image.voxels.size(); ++i)
        image.voxels[i] = static_cast<float>(
            share_beyond_plane(grid.world_mm(grid.voxel(i)) - centre, Vec3::Ones(), n));
      const auto field = find_edges(image, {EdgeContrast{0.4}, EdgeThinning::kAcross});
      ASSERT_TRUE(field);
      const auto raw = localise_edges(image, *field, EdgeCorrection::kNone);
      const auto corrected = localise_edges(image, *field);
      for (std::size_t i = 0; i < raw.size(); ++i) {
        if (near_border(raw[i].point_mm, grid)) continue;
        EXPECT_LT(corrected[i].normal.dot(n), -0.99);
        EXPECT_NEAR(n.dot(corrected[i].point_mm - centre), 0, 0.1);  // one by one
        sum[0] += n.dot(raw[i].point_mm - centre);
        sum[1] += n.dot(corrected[i].point_mm - centre);
        ++count;
      }
    }
    ASSERT_GT(count, 10);
    EXPECT_NEAR(sum[0] / count, 0, 0.02);
    EXPECT_NEAR(sum[1] / count, 0, 0.005);
    ++seen;
  }
  EXPECT_EQ(seen, 11);
}

TEST(EdgeLocalisation, CurvatureIsCorrectedToAFiftiethOfAVoxel) {
  for (const double radius : {2.5, 5.0}) {
    const ImageGrid grid = cube(static_cast<int>(2 * radius) + 22);
    const Vec3 centre = Vec3::Constant(grid.size[0] / 2) + Vec3(0.23, -0.14, 0.07);
    for (const bool ball : {true, false}) {
      const Vec3 axis = ball ? Vec3(Vec3::Zero()) : Vec3(Vec3(0.3, 0.2, 1).normalized());
      const Bias bias = bias_on(grid, centre, axis, radius);
      EXPECT_GT(bias.count, 50);
      EXPECT_LT(std::abs(bias.corrected), 0.02) << "radius " << radius;
      EXPECT_LT(bias.raw, -0.12) << "the peak of a straight step lies inside";
    }
  }
}

TEST(EdgeLocalisation, SpacingIsHonoured) {
  ImageGrid grid = cube(36, Vec3(0.5, 0.5, 1.0));
  grid.size[2] = 20;
  const Vec3 centre(9.1, 8.9, 9.6);
  const Bias bias = bias_on(grid, centre, Vec3(Vec3(0.2, 0.1, 1).normalized()), 4.0);
  EXPECT_GT(bias.count, 100);
  EXPECT_LT(std::abs(bias.corrected), 0.02 * 0.63);  // of the edge of a voxel's volume
}

TEST(EdgeLocalisation, CurvaturesAreThoseOfTheShape) {
  const ImageGrid grid = cube(40);
  const Vec3 centre = Vec3::Constant(20.3);
  const Image<float> filled = coverage(grid, {torus(centre, Vec3::UnitZ(), 11, 4)});
  const auto field = find_edges(filled, {EdgeContrast{0.4}, EdgeThinning::kAcross});
  int outer = 0;
  for (const EdgePlace& e : localise_edges(filled, *field)) {
    if (!e.corrected) continue;
    const Vec3 d = e.point_mm - centre;
    if (std::abs(d[2]) > 0.7 || std::hypot(d[0], d[1]) < 11) continue;  // the outer equator
    EXPECT_NEAR(e.largest_curvature, 1.0 / 4, 0.06);
    EXPECT_NEAR(e.smallest_curvature, 1.0 / 15, 0.06);
    ++outer;
  }
  EXPECT_GT(outer, 30);
}

}  // namespace
}  // namespace angiospline
