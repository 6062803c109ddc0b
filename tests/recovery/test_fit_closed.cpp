// Closed surfaces: the template, the start from a mask, the fit; and groups of patches that move
// only as far as they stay sound.
#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "modeling/certificate.h"
#include "modeling/tessellation.h"
#include "recovery/closed_surface.h"
#include "recovery/fit_model.h"
#include "recovery/fit_patches.h"
#include "recovery/phantom.h"

namespace angiospline {
namespace {

TEST(ClosedSurface, IsASmoothSphereOfSixPatchesAndMore) {
  for (const int divisions : {1, 2}) {
    const SurfaceNetwork ball =
        closed_surface(Vec3(1, 2, 3), 4 * Mat3::Identity(), "ball", divisions);
    ASSERT_FALSE(find_defect(ball));
    EXPECT_EQ(ball.patches.size(), 6U * divisions * divisions);
    EXPECT_EQ(ball.joins.size(), 12U * divisions * divisions);
    EXPECT_TRUE(ball.rims.empty());
    const auto mesh = tessellate(ball);
    ASSERT_TRUE(mesh);
    for (Eigen::Index k = 0; k < mesh->mesh.points_mm.cols(); ++k) {
      EXPECT_NEAR((mesh->mesh.points_mm.col(k) - Vec3(1, 2, 3)).norm(), 4, 0.008);
    }
    const auto certificate = certify(ball);
    EXPECT_TRUE(certificate->closed && certificate->valid && !certificate->self_intersecting);
    EXPECT_LT(certificate->max_normal_angle_deg, 1e-6);
    EXPECT_GT(certificate->min_jacobian_ratio, 0.3);
    EXPECT_EQ(certificate->genus, 0);
    EXPECT_NEAR(certificate->volume_mm3, 4.0 / 3 * 3.14159265358979 * 64, 0.3);
  }
}

TEST(ClosedSurface, IsFoundAmongOtherRegions) {
  SurfaceNetwork two = closed_surface(Vec3::Zero(), Mat3::Identity(), "a");
  append(two, closed_surface(Vec3(9, 0, 0), 2 * Mat3::Identity(), "b"));
  const auto closed = closed_patches(two);
  ASSERT_EQ(closed.size(), 2U);
  EXPECT_EQ(closed[0].size(), 6U);
  EXPECT_EQ(closed[1].front(), 6);
  two.patches[6].u = KnotVector::clamped(5, {0.0, 0.5, 1.0});
  EXPECT_TRUE(closed_patches(two)[1].empty());
}

TEST(ClosedModel, HasOneEllipsoidForEachPieceOfAMask) {
  Mask mask(ImageGrid{{40, 30, 30}, Vec3(1, 1, 2), Vec3(-5, 0, 7), Mat3::Identity()});
  const Vec3 center(12, 14, 35);
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) {
    const Vec3 p = mask.grid.world_mm(mask.grid.voxel(i));
    const Vec3 d = (p - center).cwiseQuotient(Vec3(10, 6, 8));
    const bool far = (p - Vec3(32, 24, 20)).norm() < 3;
    mask.voxels[i] = d.norm() < 1 || far;
  }
  mask.voxels[0] = 1;  // too small for a surface
  const auto model = closed_model(mask);
  ASSERT_TRUE(model);
  ASSERT_EQ(model->network.regions.size(), 2U);
  ASSERT_EQ(model->warnings.size(), 1U);
  EXPECT_NE(model->warnings.front().find("1 pieces"), std::string::npos);
  const auto mesh = tessellate(model->network);
  const MeshMeasure size = measure(mesh->mesh);
  EXPECT_EQ(size.components, 2);
  EXPECT_NEAR(size.highest_mm.x(), std::max(22.0, 35.0), 0.5);
  EXPECT_NEAR(size.lowest_mm.y(), 8, 0.5);

  const auto none = closed_model(Mask(mask.grid));
  ASSERT_FALSE(none);
  EXPECT_NE(none.error().message().find("no piece large enough"), std::string::npos);
}

TEST(FitModel, PutsAClosedSurfaceOnAPotato) {
  PhantomOptions options;
  options.snr = 4;
  const auto phantom = make_phantom(PhantomKind::kPotato, options);
  Image<float> image(phantom->image.grid);
  for (std::size_t i = 0; i < image.voxels.size(); ++i) image.voxels[i] = phantom->image.voxels[i];
  const auto start = closed_model(phantom->truth);
  ASSERT_TRUE(start);
  const auto distance = [](const SurfaceNetwork& network) {
    const auto mesh = tessellate(network);
    double sum = 0;
    for (Eigen::Index k = 0; k < mesh->mesh.points_mm.cols(); ++k) {
      const Vec3 d = mesh->mesh.points_mm.col(k) - potato_center_mm();
      sum += std::abs(d.norm() - potato_radius_mm(d.normalized()));
    }
    return sum / static_cast<double>(mesh->mesh.points_mm.cols());
  };
  const auto fitted = fit_model(*start, image);
  ASSERT_TRUE(fitted) << fitted.error().message();
  EXPECT_GT(distance(start->network), 0.5);
  EXPECT_LT(distance(fitted->model.network), 0.08);
  EXPECT_TRUE(fitted->report.held.empty());
  const auto certificate = certify(fitted->model.network);
  EXPECT_TRUE(certificate->closed && certificate->valid && !certificate->self_intersecting);
  EXPECT_LT(certificate->max_normal_angle_deg, 0.01);
  EXPECT_EQ(certificate->genus, 0);
}

// The unit ball and samples of it that all move by `move`.
struct Ball {
  SurfaceNetwork network = closed_surface(Vec3::Zero(), Mat3::Identity(), "ball");
  PatchGroup group;
  std::vector<PatchSample> samples;

  explicit Ball(const std::function<Vec3(const Vec3&)>& move) {
    group = patch_group(network, closed_patches(network).front());
    std::fill(group.net.scale.begin(), group.net.scale.end(), 1.0);
    number_unknowns(group);
    for (const Join& join : network.joins) add_edge(group, join, 1);
    const auto mesh = tessellate(network, {0.01, 1e9, 0.15});
    for (std::size_t k = 0; k < mesh->origins.size(); ++k) {
      PatchSample s;
      s.patch = mesh->origins[k].patch;
      s.uv = mesh->origins[k].uv;
      s.point_mm = mesh->mesh.points_mm.col(static_cast<Eigen::Index>(k));
      s.normal = s.moved_normal = s.point_mm.normalized();
      s.move_mm = move(s.point_mm);
      s.weight = 6.0 / static_cast<double>(mesh->origins.size());
      samples.push_back(s);
    }
  }
  MovedGroup moved(double least_jacobian) {
    return move_group(group, samples, Points3::Zero(3, group.net.points.cols()), {}, {0.0, 0.03},
                      least_jacobian);
  }
};

TEST(PatchGroup, GoesTheWholeWayWhereItStaysSound) {
  Ball ball([](const Vec3& p) -> Vec3 { return 0.2 * p; });
  const MovedGroup moved = ball.moved(0.1);
  EXPECT_EQ(moved.share, 1.0);
  EXPECT_TRUE(moved.failure.empty());
  EXPECT_LT(moved.worst_angle_deg, 1e-6);
  EXPECT_TRUE(is_smooth(ball.group));
}

TEST(PatchGroup, StopsWhereItWouldFoldAndStaysSmooth) {
  // Everything is drawn into a needle: the gate on |Su x Sv| fails on the way.
  Ball ball([](const Vec3& p) -> Vec3 { return Vec3(-0.97 * p.x(), -0.97 * p.y(), 0); });
  const double ratio = jacobian_ratio(ball.group);
  const MovedGroup moved = ball.moved(0.6 * ratio);
  EXPECT_LT(moved.share, 1.0);
  EXPECT_FALSE(moved.failure.empty());
  EXPECT_TRUE(is_smooth(ball.group));
  EXPECT_GE(jacobian_ratio(ball.group), 0.6 * ratio);
}

}  // namespace
}  // namespace angiospline
