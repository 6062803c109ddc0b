// Closed surfaces: the template, the start from a mask, the fit; and groups of patches that move
// only as far as they stay sound.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "modeling/check/certificate.h"
#include "modeling/network/tessellation.h"
#include "recovery/fit/closed_pieces.h"
#include "recovery/fit/closed_surface.h"
#include "recovery/fit/fit_model.h"
#include "recovery/fit/patches.h"
#include "recovery/phantoms/phantom.h"

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

// A rod along x and a ball, each with one branch through it and the voxels of its axis.
struct RodAndBall {
  Mask mask{ImageGrid{{48, 40, 40}, Vec3::Ones(), Vec3::Zero(), Mat3::Identity()}};
  Mask skeleton{mask.grid};
  CenterlineTree tree;

  explicit RodAndBall(const Vec3& ball, bool with_rod = true) {
    const auto add = [&](const char* name, const Vec3& a, const Vec3& b, double radius) {
      const int n = static_cast<int>(tree.nodes.size());
      tree.nodes.push_back({std::string(name) + "_a", a});
      tree.nodes.push_back({std::string(name) + "_b", b});
      CenterlineBranch branch{name, n, n + 1, Points3(3, 3), Eigen::VectorXd::Constant(3, radius)};
      branch.points_mm << a, (a + b) / 2, b;
      tree.branches.push_back(branch);
      tree.inlets.push_back(n);
      for (std::size_t i = 0; i < mask.voxels.size(); ++i) {
        const Vec3 p = mask.grid.world_mm(mask.grid.voxel(i)) - a;
        const double t = std::clamp(p.dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
        const double off = (p - t * (b - a)).norm();
        if (off < radius) mask.voxels[i] = 1;
        if (off < 0.6) skeleton.voxels[i] = 1;
      }
    };
    add("ball", ball - Vec3(2, 0, 0), ball + Vec3(2, 0, 0), 6);
    if (with_rod) add("rod", Vec3(6, 8, 8), Vec3(40, 8, 8), 3);
  }
  TreeAndPieces parted() const { return part_closed_pieces(mask, skeleton, tree); }
};

TEST(ClosedPieces, AreThoseWhoseOnlyBranchIsShort) {
  const RodAndBall both(Vec3(24, 26, 26));
  const TreeAndPieces parted = both.parted();
  ASSERT_EQ(parted.tree.branches.size(), 1U);
  EXPECT_EQ(parted.tree.branches[0].name, "rod");
  ASSERT_EQ(parted.tree.nodes.size(), 2U);
  EXPECT_EQ(parted.tree.nodes[static_cast<std::size_t>(parted.tree.branches[0].from)].name,
            "rod_a");
  EXPECT_EQ(parted.tree.inlets, std::vector<int>{0});
  for (std::size_t i = 0; i < both.mask.voxels.size(); ++i) {
    const bool of_ball = both.mask.voxels[i] != 0 && both.mask.grid.voxel(i)[1] > 15;
    EXPECT_EQ(parted.pieces.voxels[i] != 0, of_ball);
  }
  // A vessel cut by the border is a vessel, however short; and one piece at least stays a vessel.
  int whole = 0;
  for (const RodAndBall& other :
       {RodAndBall(Vec3(42, 26, 26)), RodAndBall(Vec3(24, 26, 26), false)}) {
    const TreeAndPieces same = other.parted();
    EXPECT_EQ(same.tree.branches.size(), other.tree.branches.size());
    EXPECT_EQ(std::count(same.pieces.voxels.begin(), same.pieces.voxels.end(), 0),
              std::ssize(same.pieces.voxels));
    ++whole;
  }
  EXPECT_EQ(whole, 2);
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
  EXPECT_NE(model->warnings.front().text.find("1 pieces"), std::string::npos);
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
    return move_group(group, samples, Points3::Zero(3, group.net.points.cols()), {},
                      std::array{0.0, 0.03}, least_jacobian);
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
