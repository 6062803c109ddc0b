// Levels, noise and evidence of a ball in an image; and walls moved by evidence of any kind.
#include <cmath>

#include <gtest/gtest.h>

#include "base/random.h"
#include "recovery/fit/closed_surface.h"
#include "recovery/fit/refinement.h"
#include "recovery/imaging/rasterize/shapes.h"
#include "recovery/wall/displacement.h"
#include "recovery/wall/displacement_options.h"
#include "recovery/wall/evidence.h"
#include "recovery/wall/evidence_of_greys.h"
#include "recovery/wall/wall_greys.h"

namespace angiospline {
namespace {

const Vec3 kCenter(19.7, 20.2, 20.1);
constexpr double kRadius = 9;

Image<float> ball_image(double inside, double outside, double noise, std::uint64_t seed) {
  ImageGrid grid;
  grid.size = {41, 41, 41};
  Image<float> image = coverage(grid, {round_cone(kCenter, kRadius, kCenter, kRadius)});
  Random random(seed);
  for (float& v : image.voxels) {
    v = static_cast<float>(outside + (inside - outside) * static_cast<double>(v) +
                           noise * random.gaussian());
  }
  return image;
}

FitMesh ball_mesh(double radius) {
  return make_fit_mesh(closed_surface(kCenter, radius * Mat3::Identity(), "ball"), {}).value();
}

TEST(WallGreys, AreTheLevelsAndTheNoiseOfTheImage) {
  const Image<float> image = ball_image(1000, -200, 60, 3);
  const GreyField field(image);
  const FitMesh mesh = ball_mesh(kRadius);
  MeshSmoother smoother(mesh);
  const WallGreys greys = wall_greys(field, mesh, smoother, Eigen::VectorXd::Zero(mesh.size()));
  EXPECT_NEAR(greys.contrast, 1200, 25);
  EXPECT_NEAR(greys.inside.mean(), 1000, 15);
  EXPECT_NEAR(greys.outside.mean(), -200, 15);
  EXPECT_NEAR(greys.noise, 60, 6);
  EXPECT_EQ(greys.kind, NoiseKind::kWhite);
  EXPECT_NEAR(greys.snr(), 20, 2);
  // Half the window, half the variance of its sum.
  EXPECT_NEAR(greys.noise_density(field, 1, smoother),
              2 * greys.noise_density(field, 0.5, smoother), 1e-12);
}

TEST(WallGreys, FollowABackgroundThatRises) {
  Image<float> image = ball_image(1000, 0, 0, 1);
  for (std::size_t i = 0; i < image.voxels.size(); ++i) {
    image.voxels[i] += static_cast<float>(10 * image.grid.voxel(i)[0]);
  }
  const GreyField field(image);
  const FitMesh mesh = ball_mesh(kRadius);
  MeshSmoother smoother(mesh);
  const WallGreys greys = wall_greys(field, mesh, smoother, Eigen::VectorXd::Zero(mesh.size()));
  double low = 0, high = 0;
  for (int k = 0; k < mesh.size(); ++k) {
    const WallPoint& node = mesh.nodes[static_cast<std::size_t>(k)];
    if (node.normal.x() < -0.95) low = greys.outside(k);
    if (node.normal.x() > 0.95) high = greys.outside(k);
  }
  EXPECT_GT(high - low, 100);
}

TEST(WeighOutliers, LessensWhatStandsOutAndNothingElse) {
  Random random(4);
  Eigen::VectorXd residual(400), base = Eigen::VectorXd::Ones(400), weights(400);
  for (double& r : residual) r = random.uniform(-1, 1);
  residual(7) = 50;
  base(9) = 0;
  residual(9) = 1e6;
  weigh_outliers(residual, base, 0, weights);
  EXPECT_LT(weights(7), 0.01);
  EXPECT_EQ(weights(9), 0);
  weights(7) = 1;
  weights(9) = 1;
  EXPECT_EQ(weights, Eigen::VectorXd::Ones(400));
}

TEST(EvidenceOfGreys, AsksTheWayToTheWall) {
  const Image<float> image = ball_image(1000, 0, 10, 5);
  const GreyField field(image);
  for (const double off : {-0.5, 0.0, 0.4}) {
    const FitMesh mesh = ball_mesh(kRadius + off);
    MeshSmoother smoother(mesh);
    EvidenceOfGreys evidence(field);
    const Eigen::VectorXd still = Eigen::VectorXd::Zero(mesh.size());
    EXPECT_FALSE(evidence.found());
    evidence.look(mesh, smoother, still);
    ASSERT_TRUE(evidence.found());
    const WallOffsets offsets = evidence.offsets(mesh, still, 2);
    EXPECT_NEAR(offsets.mm.mean(), -off, 0.05);
    EXPECT_GT(offsets.weight.minCoeff(), 0);
    // Measured from where displacements have taken the nodes.
    const WallOffsets there =
        evidence.offsets(mesh, Eigen::VectorXd::Constant(mesh.size(), -off), 2);
    EXPECT_NEAR(there.mm.mean(), 0, 0.05);
    ASSERT_EQ(evidence.support(mesh, still).size(), 1U);
    EXPECT_GT(evidence.support(mesh, still)[0], 0.7);
  }
}

TEST(EvidenceOfGreys, DoesNotMeasureKnownLevelsAgain) {
  const Image<float> image = ball_image(1000, 0, 10, 5);
  const GreyField field(image);
  const FitMesh mesh = ball_mesh(kRadius);
  MeshSmoother smoother(mesh);
  const Eigen::VectorXd still = Eigen::VectorXd::Zero(mesh.size());
  WallGreys known = wall_greys(field, mesh, smoother, still);
  known.inside.array() += 500;
  EvidenceOfGreys evidence(field, known);
  EXPECT_TRUE(evidence.found());
  evidence.look(mesh, smoother, still);
  EXPECT_EQ(evidence.greys().inside, known.inside);
}

TEST(EvidenceOfGreys, HasNoneAwayFromAnyWall) {
  const Image<float> image = ball_image(1000, 0, 10, 6);
  const GreyField field(image);
  const FitMesh on = ball_mesh(kRadius), within = ball_mesh(kRadius / 2);
  MeshSmoother smoother(on);
  EvidenceOfGreys evidence(field);
  evidence.look(on, smoother, Eigen::VectorXd::Zero(on.size()));
  EXPECT_LT(evidence.support(within, Eigen::VectorXd::Zero(within.size()))[0], 0.1);
}

// A wall known exactly: a sphere, whatever an image would show.
class EvidenceOfASphere : public Evidence {
 public:
  EvidenceOfASphere(const Vec3& center, double radius) : center_(center), radius_(radius) {}

  void look(const FitMesh&, MeshSmoother&, const Eigen::VectorXd&) override { ++looks; }
  bool found() const override { return looks > 0; }
  double voxel_mm() const override { return 1; }
  double snr() const override { return 20; }
  WallOffsets offsets(const FitMesh& mesh, const Eigen::VectorXd& displacement,
                      double) const override {
    WallOffsets all{Eigen::VectorXd(mesh.size()), Eigen::VectorXd::Ones(mesh.size())};
    for (int k = 0; k < mesh.size(); ++k) {
      const WallPoint& node = mesh.nodes[static_cast<std::size_t>(k)];
      all.mm(k) = radius_ - (node.point_mm + displacement(k) * node.normal - center_).norm();
    }
    return all;
  }
  double noise_density(double, const MeshSmoother&) const override { return 1e-6; }
  std::vector<double> support(const FitMesh& mesh, const Eigen::VectorXd&) const override {
    return std::vector<double>(static_cast<std::size_t>(mesh.regions.back()) + 1, 1.0);
  }

  int looks = 0;

 private:
  Vec3 center_;
  double radius_;
};

TEST(WallDisplacement, FollowsEvidenceOfAnyKind) {
  const FitMesh mesh = ball_mesh(kRadius);
  MeshSmoother smoother(mesh);
  EvidenceOfASphere evidence(kCenter, kRadius + 0.7);
  const Displacement moved = wall_displacement(evidence, mesh, smoother);
  EXPECT_EQ(evidence.looks, 2);  // in the first round and in the last
  EXPECT_LT((moved.normal_mm.array() - 0.7).abs().maxCoeff(), 0.02);
  EXPECT_LT(moved.residual_mm.cwiseAbs().maxCoeff(), 0.02);
}

TEST(WallDisplacement, GoesNoFartherThanItMay) {
  const FitMesh mesh = ball_mesh(kRadius);
  MeshSmoother smoother(mesh);
  EvidenceOfASphere evidence(kCenter, 3 * kRadius);
  DisplacementOptions options;
  options.largest_move_radii = 0.1;
  const Displacement moved = wall_displacement(evidence, mesh, smoother, options);
  for (int k = 0; k < mesh.size(); ++k) {
    EXPECT_NEAR(moved.normal_mm(k), 0.1 * mesh.radii_mm[static_cast<std::size_t>(k)], 1e-9);
  }
}

TEST(WallDisplacement, MovesABallOfAnImageOntoItsWall) {
  const Image<float> image = ball_image(1000, 0, 80, 8);
  const GreyField field(image);
  const FitMesh mesh = ball_mesh(kRadius + 0.6);
  MeshSmoother smoother(mesh);
  EvidenceOfGreys evidence(field);
  const Displacement moved = wall_displacement(evidence, mesh, smoother);
  EXPECT_NEAR(moved.normal_mm.mean(), -0.6, 0.05);
  EXPECT_LT((moved.normal_mm.array() + 0.6).abs().maxCoeff(), 0.3);
  EXPECT_GT(moved.degrees_of_freedom, 0);
}

TEST(WallDisplacement, StaysWhereNothingIsFound) {
  const Image<float> image(ball_image(0, 0, 0, 1).grid, 7);
  const GreyField field(image);
  const FitMesh mesh = ball_mesh(kRadius);
  MeshSmoother smoother(mesh);
  EvidenceOfGreys evidence(field);
  const Displacement moved = wall_displacement(evidence, mesh, smoother);
  EXPECT_EQ(moved.normal_mm, Eigen::VectorXd::Zero(mesh.size()));
  EXPECT_EQ(moved.weight, Eigen::VectorXd::Zero(mesh.size()));
}

TEST(LargeResiduals, AreWhereTheWallLiesElsewhereAndNowhereElse) {
  const SurfaceNetwork network = closed_surface(kCenter, kRadius * Mat3::Identity(), "ball");
  const FitMesh mesh = ball_mesh(kRadius);
  MeshSmoother smoother(mesh);
  EvidenceOfASphere on(kCenter, kRadius), shifted(kCenter + Vec3(0, 0, 0.5), kRadius);
  const Eigen::VectorXd still = Eigen::VectorXd::Zero(mesh.size());
  on.look(mesh, smoother, still);
  shifted.look(mesh, smoother, still);
  EXPECT_FALSE(large_residuals(on, network, mesh, smoother, {0}).any());
  const LargeResiduals large = large_residuals(shifted, network, mesh, smoother, {0});
  ASSERT_TRUE(large.any());
  for (int k = 0; k < mesh.size(); ++k) {
    const double z = mesh.nodes[static_cast<std::size_t>(k)].normal.z();
    if (std::abs(z) > 0.4) {
      EXPECT_TRUE(large.large[static_cast<std::size_t>(k)]);
    }
    if (std::abs(z) < 0.1) {
      EXPECT_FALSE(large.large[static_cast<std::size_t>(k)]);
    }
  }
  EXPECT_FALSE(large_residuals(shifted, network, mesh, smoother, {1}).any());
}

}  // namespace
}  // namespace angiospline
