// More freedom where residuals are large: blebs, bulges, throats; and none where there are none.
#include <algorithm>
#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "base/random.h"
#include "modeling/build/build_model.h"
#include "modeling/check/certificate.h"
#include "modeling/network/tessellation.h"
#include "recovery/fit/closed_surface.h"
#include "recovery/fit/fit_model.h"
#include "recovery/imaging/rasterize/shapes.h"
#include "recovery/wall/wall_mesh_part.h"

namespace angiospline {
namespace {

const Vec3 kMiddle(24.2, 23.9, 30.3);
constexpr double kRadius = 6.0, kBottom = 4.0, kTop = 57.0;

using Level = std::function<double(const Vec3&)>;  // zero on the wall, slope about one

double tube(const Vec3& p) { return (p - kMiddle).head<2>().norm() - kRadius; }

double tube_with_bleb(const Vec3& p) {
  const Vec3 d = p - kMiddle;
  const double around = kRadius * std::atan2(d.y(), d.x());
  return tube(p) - 2 * std::exp(-(around * around + d.z() * d.z()) / 8);
}

double tube_with_throat(const Vec3& p) {
  const double z = (p - kMiddle).z();
  return tube(p) + 2.5 * std::exp(-z * z / 12.5);
}

double ball_with_bulge(const Vec3& p) {
  const Vec3 d = p - kMiddle;
  const double angle = std::acos(std::clamp(d.normalized().x(), -1.0, 1.0));
  return d.norm() - 11 - 2.5 * std::exp(-angle * angle / (2 * 0.175 * 0.175));
}

Image<float> image_of(const Level& level, bool open, double snr, std::uint64_t seed) {
  ImageGrid grid;
  grid.size = {48, 48, 62};
  const Shape shape{[&](const Vec3& p) {
                      const double ends = std::max(kBottom - p.z(), p.z() - kTop);
                      return open ? std::max(level(p), ends) : level(p);
                    },
                    Vec3::Zero(), Vec3(47, 47, 61), 2.5};
  Image<float> image = coverage(grid, {shape});
  Random random(seed);
  for (float& v : image.voxels) v = v * 1000 + static_cast<float>(1000 / snr * random.gaussian());
  return image;
}

CenterlineTree straight() {
  CenterlineTree tree;
  CenterlineBranch axis;
  axis.name = "vessel";
  axis.from = 0;
  axis.to = 1;
  axis.points_mm.resize(3, 2);
  axis.points_mm << kMiddle.x(), kMiddle.x(), kMiddle.y(), kMiddle.y(), kBottom, kTop;
  axis.radii_mm = Vec2::Constant(kRadius);
  tree.nodes = {{"bottom", axis.points_mm.col(0)}, {"top", axis.points_mm.col(1)}};
  tree.inlets = {0};
  tree.branches = {axis};
  return tree;
}

struct Distances {
  double near = 0, elsewhere = 0;
};

// Mean distances of the tessellation's points, within 5 of a place and elsewhere, ends left out.
Distances distances(const SurfaceNetwork& network, const Level& level, const Vec3& place) {
  const auto mesh = tessellate(network, {0.02, 0.02, 0.2});
  double near = 0, near_count = 0, far = 0, far_count = 0;
  for (std::size_t k = 0; k < mesh->origins.size(); ++k) {
    const Vec3 p = mesh->mesh.points_mm.col(static_cast<Eigen::Index>(k));
    if (!network.rims.empty() && (p.z() < kBottom + 3 || p.z() > kTop - 3)) continue;
    const double off = std::abs(level(p));
    ((p - place).norm() < 5 ? near : far) += off;
    ((p - place).norm() < 5 ? near_count : far_count) += 1;
  }
  EXPECT_GT(near_count, 20);
  return {near / near_count, far / far_count};
}

void expect_sound(const SurfaceNetwork& network) {
  const auto certificate = certify(network);
  EXPECT_TRUE(certificate->closed && certificate->valid && !certificate->self_intersecting);
  EXPECT_LT(certificate->max_normal_angle_deg, 0.005);
}

TEST(FitRefinement, GivesABodyMoreKnotsAtABleb) {
  const Image<float> image = image_of(tube_with_bleb, true, 8, 3);
  const auto seed = build_model(straight());
  FitOptions once;
  once.refinements = 0;
  const auto coarse = fit_model(*seed, image, once);
  const auto fine = fit_model(*seed, image);
  ASSERT_TRUE(coarse && fine);
  EXPECT_TRUE(coarse->report.refined.empty());
  EXPECT_EQ(fine->report.refined, std::vector<std::string>{"wall_vessel"});
  EXPECT_GT(fine->report.control_points_before_reduction,
            coarse->report.control_points_before_reduction);
  const Vec3 place = kMiddle + Vec3(kRadius + 2, 0, 0);
  const Distances before = distances(coarse->model.network, tube_with_bleb, place);
  const Distances after = distances(fine->model.network, tube_with_bleb, place);
  EXPECT_LT(after.near, 0.7 * before.near);
  EXPECT_LT(after.elsewhere, 1.2 * before.elsewhere);
  expect_sound(fine->model.network);
}

TEST(FitRefinement, QuartersAClosedSurfaceAtABulge) {
  const Image<float> image = image_of(ball_with_bulge, false, 8, 3);
  Mask mask(image.grid);
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) {
    mask.voxels[i] = ball_with_bulge(mask.grid.world_mm(mask.grid.voxel(i))) < 0;
  }
  const auto start = closed_model(mask);
  FitOptions once;
  once.refinements = 0;
  const auto coarse = fit_model(*start, image, once);
  const auto fine = fit_model(*start, image);
  ASSERT_TRUE(coarse && fine);
  EXPECT_EQ(fine->report.refined.size(), 1U);
  EXPECT_EQ(fine->model.network.patches.size(), 24U);
  const Vec3 place = kMiddle + Vec3(13.5, 0, 0);
  const Distances before = distances(coarse->model.network, ball_with_bulge, place);
  const Distances after = distances(fine->model.network, ball_with_bulge, place);
  EXPECT_LT(after.near, 0.8 * before.near);
  EXPECT_LT(after.elsewhere, 1.2 * before.elsewhere);
  expect_sound(fine->model.network);
}

TEST(FitMeshPart, HasTheWholeMeshsAnswersInItsMiddle) {
  const auto model = build_model(straight());
  FitMeshOptions spacing;
  const auto whole = make_fit_mesh(model->network, spacing);
  const Vec3 place = kMiddle + kRadius * Vec3::UnitX();
  const FitMeshPart part = part_near(*whole, place, 12.0);
  ASSERT_GT(part.mesh.size(), 200);
  ASSERT_LT(2 * part.mesh.size(), whole->size());
  Random random(3);
  Eigen::VectorXd values(whole->size()), there(part.mesh.size());
  for (double& v : values) v = random.gaussian();
  for (int k = 0; k < part.mesh.size(); ++k) {
    const int node = part.nodes[static_cast<std::size_t>(k)];
    there(k) = values(node);
    ASSERT_EQ(part.mesh.nodes[static_cast<std::size_t>(k)].point_mm,
              whole->nodes[static_cast<std::size_t>(node)].point_mm);
  }
  MeshSmoother smooth_whole(*whole), smooth_part(part.mesh);
  const auto ones = [](Eigen::Index n) { return Eigen::VectorXd::Ones(n).eval(); };
  const Eigen::VectorXd mean = smooth_whole.mean(values, ones(values.size()), 1.0);
  const Eigen::VectorXd mean_there = smooth_part.mean(there, ones(there.size()), 1.0);
  const Eigen::VectorXd fair =
      smooth_whole.fair(values, ones(values.size()), 6.0 * ones(values.size()));
  const Eigen::VectorXd fair_there =
      smooth_part.fair(there, ones(there.size()), 6.0 * ones(there.size()));
  int middle = 0;
  for (int k = 0; k < part.mesh.size(); ++k) {
    const int node = part.nodes[static_cast<std::size_t>(k)];
    if ((whole->nodes[static_cast<std::size_t>(node)].point_mm - place).norm() > 4) continue;
    ++middle;
    EXPECT_NEAR(mean_there(k), mean(node), 2e-3);
    EXPECT_NEAR(fair_there(k), fair(node), 2e-3);
  }
  EXPECT_GT(middle, 20);
  // Values go back to where they came from; elsewhere there are none.
  const Eigen::VectorXd back = part.spread(there, whole->size());
  EXPECT_NEAR(back.squaredNorm(), there.squaredNorm(), 1e-9);
  EXPECT_EQ(back(part.nodes[5]), values(part.nodes[5]));
}

TEST(FitRefinement, LeavesAPlainWallAlone) {
  for (const double snr : {8.0, 2.0}) {
    const auto fitted = fit_model(*build_model(straight()), image_of(tube, true, snr, 7));
    ASSERT_TRUE(fitted);
    EXPECT_TRUE(fitted->report.refined.empty()) << snr;
  }
}

TEST(FitModel, FitsAThroatWithoutFoldingNearItsEnds) {
  // Spans there have hardly more nodes than rows of control points.
  for (const std::uint64_t seed : {1, 2, 3}) {
    const Image<float> image = image_of(tube_with_throat, true, 8, seed);
    const auto fitted = fit_model(*build_model(straight()), image);
    ASSERT_TRUE(fitted);
    EXPECT_TRUE(fitted->report.held.empty()) << seed;
    const Distances d =
        distances(fitted->model.network, tube_with_throat, kMiddle + Vec3(3.5, 0, 0));
    EXPECT_LT(d.near, 0.1) << seed;
    expect_sound(fitted->model.network);
  }
}

TEST(ClosedSurface, StaysTheSameWhenItsPatchesAreQuartered) {
  SurfaceNetwork two = closed_surface(Vec3(1, 2, 3), Vec3(4, 5, 6).asDiagonal(), "a");
  append(two, closed_surface(Vec3(30, 0, 0), 2 * Mat3::Identity(), "b"));
  const SurfaceNetwork finer = with_quartered(two, closed_patches(two)[0]);
  ASSERT_FALSE(find_defect(finer));
  EXPECT_EQ(finer.patches.size(), 30U);
  EXPECT_EQ(finer.joins.size(), 12U + 48U);
  EXPECT_EQ(closed_patches(finer)[0].size(), 24U);
  for (int p = 0; p < 6; ++p) {  // the first quarter keeps its number
    const auto old = patch_surface(two, p), quarter = patch_surface(finer, p);
    for (const double u : {0.0, 0.3, 1.0}) {
      EXPECT_LT((quarter.at(u, 0.7) - old.at(u / 2, 0.35)).norm(), 1e-12);
    }
  }
  const auto before = certify(two), after = certify(finer);
  EXPECT_NEAR(after->volume_mm3, before->volume_mm3, 1e-6 * before->volume_mm3);
  EXPECT_LT(after->max_normal_angle_deg, 1e-6);
}

}  // namespace
}  // namespace angiospline
