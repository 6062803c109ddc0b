// Where a wall lies along a normal: against images whose walls are known exactly.
#include <cmath>
#include <functional>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "base/random.h"
#include "recovery/wall/rules.h"
#include "recovery/wall/wall_profile.h"

namespace angiospline {
namespace {

using Level = std::function<double(const Vec3&)>;

ImageGrid turned_grid() {
  ImageGrid grid;
  grid.size = {40, 40, 40};
  grid.spacing_mm = Vec3(0.5, 0.4, 0.6);
  grid.origin_mm = Vec3(-7, 3, 11);
  grid.direction = Eigen::AngleAxisd(0.4, Vec3(1, 2, -1).normalized()).toRotationMatrix();
  return grid;
}

Image<float> image_of(const ImageGrid& grid, const Level& grey) {
  Image<float> image(grid);
  for (std::size_t i = 0; i < image.voxels.size(); ++i) {
    image.voxels[i] = static_cast<float>(grey(grid.world_mm(grid.voxel(i))));
  }
  return image;
}

// 1000 inside a wall at `beyond` = 0, 100 outside, blurred by so much.
double blurred(double beyond, double sigma) {
  return 100 + 900 * std::erfc(beyond / (std::sqrt(2.0) * sigma)) / 2;
}

TEST(GreyField, ReproducesQuadraticsBetweenVoxels) {
  const ImageGrid grid = turned_grid();
  const auto quadratic = [&](const Vec3& p) {
    const Vec3 x = grid.index_vox(p) / 10;
    return 3 + x.x() - 2 * x.y() * x.z() + x.x() * x.x() - 0.5 * x.z() * x.z();
  };
  const Image<float> image = image_of(grid, quadratic);
  const GreyField field(image);
  Random random(1);
  for (int k = 0; k < 200; ++k) {
    const Vec3 p =
        grid.world_mm(Vec3(random.uniform(2, 37), random.uniform(2, 37), random.uniform(2, 37)));
    EXPECT_NEAR(field.at(p), quadratic(p), 1e-4);
  }
  EXPECT_NEAR(field.voxel_mm(), std::cbrt(0.5 * 0.4 * 0.6), 1e-12);
  EXPECT_NEAR(field.width_mm(grid.direction.col(2)), 0.6, 1e-12);
}

TEST(GreyField, HoldsItsBorderAndKnowsWhereItEnds) {
  const ImageGrid grid = turned_grid();
  const Image<float> image = image_of(grid, [&](const Vec3& p) { return grid.index_vox(p).x(); });
  const GreyField field(image);
  EXPECT_TRUE(field.covers(grid.world_mm(Vec3(-0.4, 20, 20))));
  EXPECT_FALSE(field.covers(grid.world_mm(Vec3(-0.6, 20, 20))));
  EXPECT_NEAR(field.at(grid.world_mm(Vec3(-5, 20, 20))), 0, 1e-6);
  EXPECT_NEAR(field.at(grid.world_mm(Vec3(99, 20, 20))), 39, 1e-5);
}

TEST(ParallelPoint, OfASphereHasTheRadiusOfTheParallelSphere) {
  const WallPoint p{Vec3(1, 2, 3), Vec3::UnitX(), 1.0 / 4, 1.0 / 4};
  const WallPoint q = parallel_point(p, 0.5);
  EXPECT_EQ(q.point_mm, Vec3(1.5, 2, 3));
  EXPECT_NEAR(q.largest_curvature, 1 / 4.5, 1e-14);
  // Past the centre a curvature would have no meaning: it grows to five times at most.
  EXPECT_NEAR(parallel_point(p, -10).largest_curvature, 1 / (4 * wall_rules::kLeastGrowth), 1e-14);
}

TEST(WallOffset, FindsAPlaneWallWhereverItIsLookedFor) {
  const ImageGrid grid = turned_grid();
  const Vec3 n = Vec3(1, -1, 2).normalized(), middle = grid.world_mm(Vec3(20, 20, 20));
  for (const double sigma : {0.2, 0.4}) {
    const Image<float> image =
        image_of(grid, [&](const Vec3& p) { return blurred(n.dot(p - middle), sigma); });
    const GreyField field(image);
    for (const double off : {-0.6, -0.2, 0.0, 0.3, 0.6}) {
      const WallPoint at{middle + off * n, n, 0, 0};
      const WallOffset found = wall_offset(field, at, {1000, 100}, {4.0, 0});
      ASSERT_TRUE(found.measured);
      EXPECT_NEAR(found.offset_mm, -off, 0.01);
    }
  }
}

TEST(WallOffset, DoesNotShrinkASphereThatIsBlurred) {
  ImageGrid grid;
  grid.size = {41, 41, 41};
  const Vec3 center(20.2, 19.9, 20.1);
  // A ball blurred by a Gaussian, exactly (radially symmetric convolution).
  const double R = 8, s = 1.0;
  const auto ball = [&](const Vec3& p) {
    const double r = std::max(1e-9, (p - center).norm());
    const auto e = [&](double x) { return std::erf(x / (std::sqrt(2.0) * s)); };
    const auto g = [&](double x) { return std::exp(-x * x / (2 * s * s)); };
    const double share = (e(R - r) + e(R + r)) / 2 -
                         s / (r * std::sqrt(2 * 3.14159265358979)) * (g(R - r) - g(R + r));
    return 100 + 900 * share;
  };
  const Image<float> image = image_of(grid, ball);
  const GreyField field(image);
  for (const Vec3& d : {Vec3(1, 0, 0), Vec3(1, 2, -1), Vec3(-1, 1, 3)}) {
    const Vec3 n = d.normalized();
    const WallPoint at{center + R * n, n, 1 / R, 1 / R};
    const double curved = wall_offset(field, at, {1000, 100}, {4.0, 0}).offset_mm;
    const WallPoint flat{center + R * n, n, 0, 0};
    EXPECT_NEAR(curved, 0, 0.02);
    // Without the strip's growth the same profile says that the ball is smaller.
    EXPECT_LT(wall_offset(field, flat, {1000, 100}, {4.0, 0}).offset_mm, -0.08);
  }
}

TEST(WallOffset, IsHeldWhereAnotherVesselBegins) {
  const ImageGrid grid = turned_grid();
  const Vec3 n = Vec3::UnitX(), middle = grid.world_mm(Vec3(20, 20, 20));
  const Image<float> image = image_of(grid, [&](const Vec3& p) {
    const double s = n.dot(p - middle);
    return blurred(s, 0.2) + blurred(1.6 - s, 0.2) - 100;
  });
  const GreyField field(image);
  const WallOffset found = wall_offset(field, {middle, n, 0, 0}, {1000, 100}, {4.0, 10});
  ASSERT_TRUE(found.measured);
  EXPECT_NEAR(found.offset_mm, 0, 0.03);
}

TEST(WallOffset, IsNotMeasuredBeyondTheImageOrWithoutContrast) {
  const ImageGrid grid = turned_grid();
  const Image<float> image(grid, 5);
  const GreyField field(image);
  const Vec3 n = grid.direction.col(0);
  EXPECT_FALSE(wall_offset(field, {grid.world_mm(Vec3(39, 20, 20)), n, 0, 0}, {9, 1}).measured);
  EXPECT_FALSE(wall_offset(field, {grid.world_mm(Vec3(20, 20, 20)), n, 0, 0}, {5, 5}).measured);
}

TEST(WallSides, AreTheLevelsOnBothSidesOfAWall) {
  const ImageGrid grid = turned_grid();
  const Vec3 n = Vec3(0, 1, 0), middle = grid.world_mm(Vec3(20, 20, 20));
  const Image<float> image =
      image_of(grid, [&](const Vec3& p) { return blurred(n.dot(p - middle), 0.15); });
  const GreyField field(image);
  const WallSides sides = wall_sides(field, {middle, n, 0, 0}, 1e9);
  // Cubic interpolation rings by half a percent beside an edge as sharp as this.
  EXPECT_NEAR(sides.inside, 1000, 5);
  EXPECT_NEAR(sides.outside, 100, 5);
  // A vessel that is thinner than the blur has no inside.
  EXPECT_EQ(wall_sides(field, {middle, n, 1 / 0.3, 0}, 1e9).inside_weight, 0);
}

TEST(WallSides, EndAtTheNextVessel) {
  const ImageGrid grid = turned_grid();
  const Vec3 n = Vec3(0, 0, 1), middle = grid.world_mm(Vec3(20, 20, 20));
  const Image<float> image = image_of(grid, [&](const Vec3& p) {
    const double s = n.dot(p - middle);
    return s < 1.3 ? blurred(s, 0.15) : 1000.0;
  });
  const GreyField field(image);
  EXPECT_GT(wall_sides(field, {middle, n, 0, 0}, 1e9).outside, 300);
  EXPECT_LT(wall_sides(field, {middle, n, 0, 0}, 50).outside, 160);
}

}  // namespace
}  // namespace angiospline
