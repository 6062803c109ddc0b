#include <cmath>
#include <optional>

#include <gtest/gtest.h>

#include "recovery/analysis/compare_masks.h"
#include "recovery/imaging/image/xray.h"
#include "recovery/imaging/segment/multimodal.h"
#include "recovery/phantoms/rings.h"

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

// The experiment of thesis 7.1.
class RingsInTwoModalities : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { rings_ = *make_rings_experiment(); }
  static void TearDownTestSuite() { rings_.reset(); }

  static MultimodalSegmentation grown(RingsImages images, std::size_t seeds = 3) {
    std::vector<Vec3> at = rings_seeds_mm();
    at.resize(seeds);
    auto s = grow_rings(*rings_, images, at);
    EXPECT_TRUE(s.has_value()) << s.error().message();
    return s ? std::move(*s) : MultimodalSegmentation{};
  }

  static std::optional<RingsExperiment> rings_;
};
std::optional<RingsExperiment> RingsInTwoModalities::rings_;

TEST_F(RingsInTwoModalities, TheVolumeAloneFailsToSpanTheGaps) {
  const RingsMeasure m = measure_rings(*rings_, grown(RingsImages::kVolume).mask);
  EXPECT_GT(m.found, 0.01);
  EXPECT_LT(m.found, 0.2);
  for (const double arc : m.arc) EXPECT_LT(arc, 0.25);
  EXPECT_LT(m.artefact, 0.1);  // half-filled voxels of the wall
}

TEST_F(RingsInTwoModalities, TheProjectionsAloneFillThePlane) {
  const RingsMeasure m = measure_rings(*rings_, grown(RingsImages::kViews, 1).mask);
  EXPECT_GT(m.artefact, 0.5);
  EXPECT_GT(m.farthest_mm, 10);
}

TEST_F(RingsInTwoModalities, TogetherTheyCompleteAllThreeRings) {
  const MultimodalSegmentation s = grown(RingsImages::kBoth);
  const auto c = compare_masks(rings_->truth, s.mask);
  EXPECT_GT(c->dice, 0.9);
  EXPECT_EQ(c->result_topology.components, 3);
  const RingsMeasure m = measure_rings(*rings_, s.mask);
  EXPECT_LT(m.farthest_mm, 4);                          // four voxels of the volume: no artefact
  for (const double arc : m.arc) EXPECT_GT(arc, 0.97);  // but for single voxels
  // Both were needed.
  EXPECT_GT(s.report.by_views, 1000U);
  EXPECT_GT(s.report.by_volume, 1000U);
  EXPECT_FALSE(s.report.limit_reached);
  // The gaps of the volume were filled in.
  std::size_t changed = 0;
  const auto& before = rings_->volume.image.voxels;
  for (std::size_t i = 0; i < before.size(); ++i)
    changed += static_cast<float>(before[i]) != s.modalities.volume->voxels[i];
  EXPECT_GT(changed, 1000U);
}

TEST_F(RingsInTwoModalities, BadRequestsAreNamed) {
  EXPECT_FALSE(grow_region(Modalities{}, rings_->truth.grid, {Vec3::Zero()}).has_value());
  EXPECT_FALSE(grow_rings(*rings_, RingsImages::kBoth, {}).has_value());
  const auto outside = grow_rings(*rings_, RingsImages::kBoth, {Vec3(900, 0, 0)});
  ASSERT_FALSE(outside.has_value());
  EXPECT_EQ(outside.error().where, "seed 1");
}

}  // namespace
}  // namespace angiospline
