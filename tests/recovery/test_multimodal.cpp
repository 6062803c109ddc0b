#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "recovery/metrics.h"
#include "recovery/multimodal.h"
#include "recovery/phantom.h"

namespace angiospline {
namespace {

TEST(XrayGeometry, ProjectsTheCentreToTheMiddleAndMagnifies) {
  for (const double angle : {0.0, 30.0, 80.0, 145.0}) {
    CArm arm;
    arm.angle_deg = angle;
    arm.centre_mm = Vec3(10, 20, 30);
    const XrayGeometry g = c_arm_geometry(arm);
    const auto middle = g.project(arm.centre_mm);
    ASSERT_TRUE(middle.has_value());
    EXPECT_TRUE(middle->isApprox(Vec2(127.5, 127.5), 1e-9));
    // 3 mm up the y axis at the centre are 3 * 1000 / 750 pixels of 1 mm.
    EXPECT_NEAR((*g.project(arm.centre_mm + Vec3(0, 3, 0)))[1], 127.5 + 4, 1e-9);
    EXPECT_FALSE(g.project(g.source_mm).has_value());
    EXPECT_FALSE(g.project(2 * g.source_mm - arm.centre_mm).has_value());  // behind the source
  }
}

TEST(XrayGeometry, AViewOfABallHasItsChordInTheMiddle) {
  Image<float> ball;
  ball.grid.size = {41, 41, 41};
  ball.voxels.resize(ball.grid.voxel_count());
  for (std::size_t i = 0; i < ball.voxels.size(); ++i) {
    const Voxel v = ball.grid.voxel(i);
    ball.voxels[i] = std::hypot(v[0] - 20, v[1] - 20, v[2] - 20) <= 10 ? 1.0F : 0.0F;
  }
  CArm arm;
  arm.centre_mm = Vec3(20, 20, 20);
  arm.angle_deg = 37;
  arm.pixels = 65;
  const Image<float> view = project_volume(ball, c_arm_geometry(arm), 0.05, std::nullopt);
  EXPECT_NEAR((view[{32, 32, 0}]), 1 - std::exp(-0.05 * 21), 0.02);
  EXPECT_EQ((view[{0, 0, 0}]), 0);
  const Image<float> noisy = project_volume(ball, c_arm_geometry(arm), 0.05, 20, 4);
  EXPECT_NE(noisy.voxels, view.voxels);
  EXPECT_EQ(noisy.voxels, project_volume(ball, c_arm_geometry(arm), 0.05, 20, 4).voxels);
}

// The experiment of thesis 7.1: rings with losses of signal every 45 degrees, 22.5 degrees apart in
// the volume and in four projections at 0, 30, 80 and 145 degrees; SNR 20.
class RingsInTwoModalities : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    PhantomOptions o;
    o.edges = PhantomEdges::kSteps;
    o.snr = 20;
    o.loss_deg = 12;
    o.loss_depth = 0.65;
    const Phantom volume = *make_phantom(PhantomKind::kRings, o);
    o.snr.reset();
    o.loss_phase_deg = 22.5;
    o.background = 0;
    o.vessel = 1000;
    const Phantom density = *make_phantom(PhantomKind::kRings, o);
    images_.volume = Image<float>(volume.image.grid);
    Image<float> filled(density.image.grid);
    for (std::size_t i = 0; i < filled.voxels.size(); ++i) {
      images_.volume->voxels[i] = volume.image.voxels[i];
      filled.voxels[i] = static_cast<float>(density.image.voxels[i]) / 1000;
    }
    std::uint64_t seed = 1;
    for (const double angle : {0.0, 30.0, 80.0, 145.0}) {
      CArm arm;
      arm.angle_deg = angle;
      arm.centre_mm = Vec3::Constant(63.5);
      arm.pixel_mm = 0.8;
      const XrayGeometry g = c_arm_geometry(arm);
      images_.views.push_back({g, project_volume(filled, g, 0.1, 20.0, seed++)});
    }
    PhantomOptions world;
    world.edges = PhantomEdges::kSteps;
    world.spacing_mm = Vec3::Constant(0.5);
    world.origin_mm = Vec3::Constant(-0.25);
    truth_ = make_phantom(PhantomKind::kRings, world)->truth;
  }
  static void TearDownTestSuite() {
    images_ = {};
    truth_ = {};
  }

  static Result<MultimodalSegmentation> grown(const Modalities& images, std::size_t rings = 3) {
    std::vector<Vec3> seeds;
    for (const Ring& ring : phantom_rings())
      if (seeds.size() < rings) seeds.push_back(ring.at(11.25 * std::numbers::pi / 180));
    MultimodalOptions o;
    o.volume.background = 400;
    o.max_examined = 400000;
    return grow_region(images, truth_.grid, seeds, o);
  }

  static Modalities images_;
  static Mask truth_;
};
Modalities RingsInTwoModalities::images_;
Mask RingsInTwoModalities::truth_;

TEST_F(RingsInTwoModalities, TheVolumeAloneFailsToSpanTheGaps) {
  Modalities only = images_;
  only.views.clear();
  const auto s = grown(only);
  ASSERT_TRUE(s.has_value()) << s.error().message();
  const auto c = compare_masks(truth_, s->mask);
  EXPECT_LT(c->result_voxels, truth_.voxels.size() / 100);
  EXPECT_LT(static_cast<double>(c->both), 0.2 * static_cast<double>(c->truth_voxels));
}

TEST_F(RingsInTwoModalities, TheProjectionsAloneFillThePlane) {
  Modalities only = images_;
  only.volume.reset();
  const auto s = grown(only, 1);
  ASSERT_TRUE(s.has_value()) << s.error().message();
  const auto c = compare_masks(truth_, s->mask);
  EXPECT_GT(c->beyond, c->both);  // most of it is artefact
}

TEST_F(RingsInTwoModalities, TogetherTheyCompleteAllThreeRings) {
  const auto s = grown(images_);
  ASSERT_TRUE(s.has_value()) << s.error().message();
  const auto c = compare_masks(truth_, s->mask);
  EXPECT_GT(c->dice, 0.9);
  EXPECT_EQ(c->result_topology.components, 3);
  EXPECT_LT(c->surface->hausdorff_mm, 4);  // four voxels of the volume: no artefact
  // Both were needed.
  EXPECT_GT(s->report.by_views, 1000U);
  EXPECT_GT(s->report.by_volume, 1000U);
  EXPECT_FALSE(s->report.limit_reached);
  // Every ring is whole: its centerline is vessel all the way round but for single voxels.
  for (const Ring& ring : phantom_rings()) {
    int inside = 0;
    for (int k = 0; k < 360; ++k) {
      const Vec3 at = truth_.grid.index_vox(ring.at(k * std::numbers::pi / 180));
      inside += s->mask[{static_cast<int>(std::lround(at[0])), static_cast<int>(std::lround(at[1])),
                         static_cast<int>(std::lround(at[2]))}] != 0;
    }
    EXPECT_GT(inside, 350);
  }
  // The gaps of the volume were filled in.
  std::size_t changed = 0;
  for (std::size_t i = 0; i < images_.volume->voxels.size(); ++i)
    changed += images_.volume->voxels[i] != s->modalities.volume->voxels[i];
  EXPECT_GT(changed, 1000U);
}

TEST_F(RingsInTwoModalities, BadRequestsAreNamed) {
  EXPECT_FALSE(grow_region(Modalities{}, truth_.grid, {Vec3::Zero()}).has_value());
  EXPECT_FALSE(grow_region(images_, truth_.grid, {}).has_value());
  const auto outside = grow_region(images_, truth_.grid, {Vec3(900, 0, 0)});
  ASSERT_FALSE(outside.has_value());
  EXPECT_EQ(outside.error().where, "seed 1");
}

}  // namespace
}  // namespace angiospline
