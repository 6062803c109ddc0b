// A vessel cut across, and taken on to its end: against cylinders.
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "base/random.h"
#include "recovery/centerlines/branch_tip.h"
#include "recovery/centerlines/lumen_section.h"
#include "recovery/centerlines/rules.h"
#include "recovery/imaging/rasterize/shapes.h"

namespace angiospline {
namespace {

ImageGrid grid_of(const Vec3& spacing) {
  ImageGrid grid;
  grid.spacing_mm = spacing;
  for (int k = 0; k < 3; ++k) {
    grid.size[static_cast<std::size_t>(k)] = static_cast<int>(std::lround(40 / spacing[k]));
  }
  return grid;
}

Mask mask_of(const ImageGrid& grid, const Shape& shape) {
  const Image<float> filled = coverage(grid, {shape});
  Mask mask(grid);
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) mask.voxels[i] = filled.voxels[i] >= 0.5F;
  return mask;
}

const Vec3 kFrom(19.3, 20.1, 4), kTo(20.6, 19.4, 36);
const Vec3 kAxis = (kTo - kFrom).normalized();
const Vec3 kMiddle = (kFrom + kTo) / 2;

TEST(PlaneBasis, IsRightHandedAndOrthonormal) {
  Random random(3);
  for (int k = 0; k < 30; ++k) {
    const Vec3 w = Vec3(random.gaussian(), random.gaussian(), random.gaussian()).normalized();
    const PlaneBasis basis = plane_basis(w);
    EXPECT_LT((basis.u.cross(basis.v) - w).norm(), 1e-14);
    EXPECT_NEAR(basis.u.norm(), 1, 1e-14);
  }
}

TEST(LumenSection, HasTheCenterAndRadiusOfACylinder) {
  for (const Vec3& spacing : {Vec3(1, 1, 1), Vec3(0.6, 0.6, 1.2)}) {
    const Mask mask = mask_of(grid_of(spacing), flat_cylinder(kFrom, kTo, 6));
    for (const Vec3& off : {Vec3(0, 0, 0), Vec3(1.0, 0, 0), Vec3(0.4, -0.9, 0)}) {
      const Vec3 point = kMiddle + off - off.dot(kAxis) * kAxis;
      const LumenSection section = lumen_section(mask, point, kAxis, 20);
      ASSERT_TRUE(section.closed);
      EXPECT_NEAR(section.radius_mm, 6, 0.15);
      EXPECT_LT((section.center_mm - kMiddle).norm(), 0.15);
      const CountedSection counted = counted_section(mask, section, point, kAxis, 4);
      EXPECT_NEAR(counted.radius_mm, 6, 0.08);
      EXPECT_LT((counted.center_mm - kMiddle).norm(), 0.1);
    }
  }
}

TEST(LumenSection, IsOpenWhereNoWallIsMetAndEmptyInTheBackground) {
  const Mask mask = mask_of(grid_of(Vec3::Ones()), flat_cylinder(kFrom, kTo, 6));
  EXPECT_FALSE(lumen_section(mask, kMiddle, Vec3::UnitX(), 10).closed);
  EXPECT_TRUE(lumen_section(mask, kMiddle, Vec3::UnitX(), 30).closed);
  const LumenSection outside = lumen_section(mask, Vec3(2, 2, 2), kAxis, 30);
  EXPECT_FALSE(outside.closed);
  EXPECT_EQ(outside.radius_mm, 0);
}

TEST(LumenSection, DoesNotCountAnotherVesselBesideIt) {
  ImageGrid grid = grid_of(Vec3::Ones());
  const Image<float> filled =
      coverage(grid, {flat_cylinder(kFrom, kTo, 4),
                      flat_cylinder(kFrom + Vec3(11, 0, 0), kTo + Vec3(11, 0, 0), 4)});
  Mask mask(grid);
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) mask.voxels[i] = filled.voxels[i] >= 0.5F;
  const LumenSection section = lumen_section(mask, kMiddle, kAxis, 20);
  const CountedSection counted = counted_section(mask, section, kMiddle, kAxis, 4);
  EXPECT_NEAR(counted.radius_mm, 4, 0.1);
  EXPECT_LT((counted.center_mm - kMiddle).norm(), 0.1);
}

TEST(DistanceToWall, IsTheWayLeftAndNoneInTheBackground) {
  const Mask mask = mask_of(grid_of(Vec3::Ones()), flat_cylinder(kFrom, kTo, 6));
  EXPECT_NEAR(distance_to_wall_mm(mask, kMiddle, kAxis, 99), (kTo - kMiddle).norm(), 0.6);
  EXPECT_EQ(distance_to_wall_mm(mask, kMiddle, kAxis, 5), 5);
  EXPECT_EQ(distance_to_wall_mm(mask, Vec3(1, 1, 1), kAxis, 99), 0);
}

BranchLine line_to(const Vec3& from, const Vec3& to, double radius) {
  BranchLine line;
  for (int k = 0; k <= 12; ++k) {
    line.points.emplace_back(from + (to - from) * k / 12);
    line.radii.push_back(radius);
  }
  return line;
}

TEST(BranchTip, OfACutVesselIsItsCut) {
  const Mask mask = mask_of(grid_of(Vec3::Ones()), flat_cylinder(kFrom, kTo, 6));
  // A tip is taken on as far as the rules let it go.
  const double most = centerline_rules::kTip.farthest_radii * 6;
  for (const double short_of : {2.0, 5.0, most / 2}) {
    const BranchLine line = extended_to_wall(mask, line_to(kMiddle, kTo - short_of * kAxis, 6));
    EXPECT_LT((line.points.back() - kTo).norm(), 0.7);
    ASSERT_EQ(line.points.size(), line.radii.size());
    EXPECT_EQ(line.radii.back(), 6);
  }
}

TEST(BranchTip, OfAHalfSphereIsTwoThirdsOfARadiusBeyondItsCenter) {
  const Vec3 center(20, 20, 28);
  const Mask mask = mask_of(grid_of(Vec3::Ones()), round_cone(Vec3(20, 20, 8), 6, center, 6));
  const BranchLine line =
      extended_to_wall(mask, line_to(Vec3(20, 20, 14), center - Vec3(0, 0, 1), 6));
  EXPECT_NEAR(line.points.back().z(), center.z() + 2.0 / 3 * 6, 0.6);
}

TEST(BranchTip, OfALineOfOnePlaceIsThatPlace) {
  const Mask mask = mask_of(grid_of(Vec3::Ones()), flat_cylinder(kFrom, kTo, 6));
  const BranchLine line = extended_to_wall(mask, {{kMiddle}, {6.0}});
  EXPECT_EQ(line.points.size(), 1U);
}

}  // namespace
}  // namespace angiospline
