#include <cmath>
#include <vector>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "recovery/thesis/smoothing/corner_tangents.h"
#include "recovery/thesis/smoothing/rules.h"
#include "recovery/thesis/smoothing/thesis_smoothing.h"

namespace angiospline {
namespace {

// Unit normals of all patches that have a corner at this pool column, from their control points.
std::vector<Vec3> normals_at(const SurfaceNetwork& network, int corner) {
  std::vector<Vec3> normals;
  for (int p = 0; p < static_cast<int>(network.patches.size()); ++p) {
    const BSplineSurface<3> s = patch_surface(network, p);
    const std::vector<int>& control = network.patches[static_cast<std::size_t>(p)].control;
    for (const bool u : {false, true}) {
      for (const bool v : {false, true}) {
        const int i = u ? s.u_count() - 1 : 0, j = v ? s.v_count() - 1 : 0;
        if (control[static_cast<std::size_t>(i * s.v_count() + j)] != corner) continue;
        normals.push_back(
            normal_vector(s, u ? s.u().last() : s.u().first(), v ? s.v().last() : s.v().first())
                .normalized());
      }
    }
  }
  return normals;
}

double farthest_apart(const std::vector<Vec3>& normals) {
  double worst = 0;
  for (const Vec3& a : normals)
    for (const Vec3& b : normals) worst = std::max(worst, std::atan2(a.cross(b).norm(), a.dot(b)));
  return worst;
}

TEST(FlattenCorner, GivesAllPatchesThereOneNormalAndMovesOnlyTheNextPoints) {
  const auto whole = thesis_bifurcation();
  ASSERT_TRUE(whole) << whole.error().message();
  const ThesisTessellation cut = tessellated(*whole);
  int corners = 0, rough = 0;
  for (const std::vector<int>& joins : cut.systems) {
    for (const int j : joins) {
      const Join& join = cut.network.joins[static_cast<std::size_t>(j)];
      const Patch& patch = cut.network.patches[static_cast<std::size_t>(join.a.patch)];
      // Bi-quintic patches without inner knots, as the systems' sizes rest on.
      ASSERT_EQ(patch.u.control_point_count(), thesis_smoothing_rules::kPatchRows);
      ASSERT_EQ(patch.v.control_point_count(), thesis_smoothing_rules::kPatchRows);
      SurfaceNetwork network = cut.network;
      const int corner = patch.control.back();
      const std::vector<Vec3> before = normals_at(network, corner);
      ASSERT_GE(before.size(), 3U);
      rough += farthest_apart(before) > 1e-6 ? 1 : 0;
      const double moved = flatten_corner(network, corner);
      EXPECT_LT(farthest_apart(normals_at(network, corner)), 1e-12);
      // As many points as patches meet, each by no more than was said, none of them the corner.
      const Eigen::RowVectorXd way =
          (network.control_points_mm - cut.network.control_points_mm).colwise().norm();
      EXPECT_NEAR(way.maxCoeff(), moved, 1e-15);
      EXPECT_EQ(way[corner], 0);
      EXPECT_LE((way.array() > 0).count(), static_cast<Eigen::Index>(before.size()));
      // What is flat stays.
      EXPECT_LT(flatten_corner(network, corner), 1e-14);
      ++corners;
    }
  }
  EXPECT_EQ(corners, 6);
  EXPECT_GT(rough, 0);
}

}  // namespace
}  // namespace angiospline
