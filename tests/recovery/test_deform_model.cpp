// A whole model deformed the thesis's way: edges, a solver by name, back to smooth patches.
#include <cmath>

#include <gtest/gtest.h>

#include "modeling/certificate.h"
#include "modeling/seed_model.h"
#include "recovery/deform_model.h"
#include "recovery/phantom.h"

namespace angiospline {
namespace {

struct Case {
  Image<float> image;
  Model start;
};

// A start that is off by half a voxel and 10 % too thick.
Case case_of(PhantomKind kind, const Vec3& spacing = Vec3::Ones()) {
  PhantomOptions options;
  options.snr = 8;
  options.spacing_mm = spacing;
  const auto phantom = make_phantom(kind, options);
  Case c{Image<float>(phantom->image.grid), {}};
  for (std::size_t i = 0; i < c.image.voxels.size(); ++i) {
    c.image.voxels[i] = phantom->image.voxels[i];
  }
  CenterlineTree tree = phantom->tree;
  const Vec3 shift = 0.5 * spacing.x() * Vec3::UnitX();
  for (CenterlineNode& n : tree.nodes) n.position_mm += shift;
  for (CenterlineBranch& b : tree.branches) {
    b.points_mm.colwise() += shift;
    b.radii_mm *= 1.1;
  }
  c.start = *seed_model(tree);
  return c;
}

TEST(DeformModel, ComesBackAsAClosedSmoothModelNearerToTheWall) {
  const Case c = case_of(PhantomKind::kCylinder, Vec3::Constant(2));
  for (const PotentialKind potential : {PotentialKind::kGravity, PotentialKind::kSpring}) {
    DeformModelOptions options;
    options.potential = potential;
    const auto result = deform_model(c.start, c.image, options);
    ASSERT_TRUE(result) << result.error().message();
    EXPECT_EQ(result->report.termination, Termination::kAtRest);
    const auto certificate = certify(result->model.network);
    EXPECT_TRUE(certificate->closed && certificate->valid);
    EXPECT_LT(certificate->max_normal_angle_deg, 0.01);
    // 10 % thicker is 21 % more volume; the wall found has less.
    EXPECT_LT(certificate->volume_mm3, 0.97 * certify(c.start.network)->volume_mm3);
    ASSERT_EQ(result->parts.size(), c.start.network.regions.size() + 1);
    EXPECT_EQ(result->parts.back().name, "all");
    EXPECT_GT(result->parts.back().moved_mean_mm, 0.1);
    EXPECT_GE(result->parts.back().residual_most, result->parts.back().residual_mean);
    EXPECT_EQ(result->residual_force.values.size(), result->mesh.points_mm.cols());
    for (const Rim& rim : result->model.network.rims) {
      for (const Side& side : rim.sides) {
        const BSplineSurface<3> s = patch_surface(result->model.network, side.patch);
        const Vec2 uv = side_parameters(
            result->model.network.patches[static_cast<std::size_t>(side.patch)], side.side, 0.3);
        EXPECT_NEAR((s.at(uv.x(), uv.y()) - rim.center_mm).dot(rim.normal), 0, 1e-9);
      }
    }
  }
}

TEST(DeformModel, NamesWhatIsWrong) {
  const Case c = case_of(PhantomKind::kBentVessel);
  const auto message = [&](const DeformModelOptions& options) {
    const auto result = deform_model(c.start, c.image, options);
    return result ? std::string("no error") : result.error().message();
  };
  DeformModelOptions options;
  options.strength = 0;
  EXPECT_NE(message(options).find("strength"), std::string::npos);
  options = {};
  options.stiffness = -1;
  EXPECT_NE(message(options).find("spring"), std::string::npos);
  EXPECT_NE(message(options).find("-1"), std::string::npos);
  options = {};
  options.edge_percentile = 100.5;
  EXPECT_NE(message(options).find("percent"), std::string::npos);
  Image<float> apart = c.image;
  apart.grid.origin_mm = Vec3::Constant(400);
  const auto result = deform_model(c.start, apart);
  ASSERT_FALSE(result);
  EXPECT_NE(result.error().message().find("outside the image"), std::string::npos);
}

}  // namespace
}  // namespace angiospline
