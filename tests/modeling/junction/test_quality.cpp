// The figures behind a junction's gates, and the gates.
#include <cmath>
#include <limits>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "modeling/junction/patch_basis.h"
#include "modeling/junction/quality.h"
#include "modeling/junction/rules.h"
#include "modeling/junction/smooth_junction.h"
#include "tests/modeling/junction/sample_junction.h"

namespace angiospline {
namespace {

using junction_rules::kGates;

// A sound and fair junction.
JunctionQuality good() {
  JunctionQuality q;
  q.worst_angle_deg = 1e-9;
  q.jacobian_ratio = 0.3;
  q.normal_off_target_deg = 5;
  q.off_target = 0.05;
  q.curvature_times_radius = 4;
  q.distance_to_union = 0.1;
  return q;
}

class QualityOf : public testing::Test {
 protected:
  QualityOf()
      : j(sample_junction(y_spec())), net(smooth_junction(j.topology, j.target, j.layout).net) {}

  SampleJunction j;
  JunctionNet net;
};

TEST_F(QualityOf, ASmoothJunctionPassesEveryGate) {
  const JunctionQuality q = junction_quality(j.topology, j.target, net);
  EXPECT_TRUE(is_sound(q)) << failed_gate(q);
  EXPECT_TRUE(is_fair(q));
  EXPECT_LT(q.worst_angle_deg, 1e-6);
  EXPECT_GT(q.jacobian_ratio, kGates.least_jacobian_ratio);
  EXPECT_FALSE(q.self_intersecting);
  EXPECT_TRUE(failed_gate(q).empty());
}

TEST_F(QualityOf, FiguresOfShapeAloneDoNotNeedATarget) {
  const JunctionQuality with = junction_quality(j.topology, j.target, net);
  const JunctionQuality without = junction_quality(j.topology, net);
  EXPECT_EQ(with.worst_angle_deg, without.worst_angle_deg);
  EXPECT_EQ(with.jacobian_ratio, without.jacobian_ratio);
  EXPECT_EQ(without.off_target, 0);
  EXPECT_EQ(without.normal_off_target_deg, 0);
}

TEST_F(QualityOf, ADentBesideAnEdgeBreaksTangentPlanes) {
  net.points.col(net.grid.at(0, 3, 1)) += Vec3(0.02, 0.03, 0.05);
  const JunctionQuality q = junction_quality(j.topology, j.target, net);
  EXPECT_GT(q.worst_angle_deg, 0.1);
  EXPECT_FALSE(is_sound(q));
  EXPECT_NE(failed_gate(q).find("normals of neighbouring patches"), std::string::npos);
}

TEST_F(QualityOf, APatchTurnedOverIsNoticed) {
  for (int a = 2; a < 5; ++a) {
    for (int b = 1; b < 3; ++b) {
      net.points.col(net.grid.at(0, a, b)).swap(net.points.col(net.grid.at(0, a, 5 - b)));
    }
  }
  EXPECT_FALSE(is_sound(junction_quality(j.topology, j.target, net)));
}

TEST_F(QualityOf, APointThatIsNoNumberFailsAGate) {
  net.points(1, net.grid.at(1, 3, 3)) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(is_sound(junction_quality(j.topology, j.target, net)));
}

TEST_F(QualityOf, NormalsStandOnTheSurface) {
  const Points3 normals = junction_normals(j.topology, net);
  constexpr int kGrid = junction_rules::kQualityGrid;
  ASSERT_EQ(normals.cols(), static_cast<Eigen::Index>(j.topology.patches.size()) * kGrid * kGrid);
  for (int p = 0; p < static_cast<int>(j.topology.patches.size()); ++p) {
    const PatchNet P = patch_net(net, p);
    for (int k = 0; k < kGrid * kGrid; ++k) {
      const PatchBasis f = patch_basis(Vec2(k / kGrid, k % kGrid) / (kGrid - 1));
      const Vec3 n = normals.col(p * kGrid * kGrid + k);
      EXPECT_NEAR(n.norm(), 1, 1e-12);
      EXPECT_NEAR(n.dot((P * f.u).normalized()), 0, 1e-9);
      EXPECT_NEAR(n.dot((P * f.v).normalized()), 0, 1e-9);
      EXPECT_GT(n.dot((P * f.u).cross(P * f.v)), 0);
    }
  }
}

TEST(Gates, EachFailsByItself) {
  ASSERT_TRUE(is_faithful(good(), 8));
  const auto breaks = [](auto&& change) {
    JunctionQuality q = good();
    change(q);
    return q;
  };
  for (const double bad : {2.0, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_FALSE(
        is_sound(breaks([&](auto& q) { q.worst_angle_deg = bad * kGates.worst_angle_deg; })));
    EXPECT_FALSE(
        is_sound(breaks([&](auto& q) { q.jacobian_ratio = kGates.least_jacobian_ratio / bad; })));
    EXPECT_FALSE(is_sound(
        breaks([&](auto& q) { q.normal_off_target_deg = bad * kGates.most_off_target_deg; })));
    EXPECT_FALSE(
        is_fair(breaks([&](auto& q) { q.curvature_times_radius = bad * kGates.fair_curvature; })));
    EXPECT_FALSE(
        is_fair(breaks([&](auto& q) { q.distance_to_union = bad * kGates.fair_distance; })));
  }
  EXPECT_FALSE(is_sound(breaks([](auto& q) { q.self_intersecting = true; })));
}

TEST(Gates, ASurfaceMayBeAsSharpAsItsTargetButNotUnfair) {
  JunctionQuality fair = good(), unfair = good();
  fair.curvature_times_radius = 0.99 * kGates.fair_curvature;
  unfair.curvature_times_radius = 1.01 * kGates.fair_curvature;
  EXPECT_GT(departure(unfair), 1);
  EXPECT_LE(departure(good()), 1);
  EXPECT_FALSE(is_faithful(fair, 8));
  // As sharp as its target is as good as can be.
  fair.target_curvature = fair.curvature_times_radius;
  EXPECT_TRUE(is_faithful(fair, 8));
}

}  // namespace
}  // namespace angiospline
