#include <set>

#include <gtest/gtest.h>

#include "base/random.h"
#include "modeling/build/build_model.h"
#include "modeling/continuity/mend_bodies.h"
#include "modeling/continuity/rules.h"
#include "tests/shapes/network_measures.h"

namespace angiospline {
namespace {

// One vessel along a gentle bend, with open ends.
SurfaceNetwork one_vessel() {
  CenterlineTree tree;
  tree.source = "test";
  tree.nodes = {{"a", Vec3(0, 0, 0)}, {"b", Vec3(3, 0, 30)}};
  tree.inlets = {0};
  CenterlineBranch branch;
  branch.name = "a_b";
  branch.from = 0;
  branch.to = 1;
  branch.points_mm.resize(3, 13);
  for (int k = 0; k < 13; ++k) branch.points_mm.col(k) << 3.0 * k * k / 144, 0, 2.5 * k;
  branch.radii_mm = Eigen::VectorXd::LinSpaced(13, 2.0, 1.5);
  tree.branches = {branch};
  const auto model = build_model(tree);
  EXPECT_TRUE(model) << model.error().message();
  return model->network;
}

TEST(BodyRings, AreTheStripsAroundEachBody) {
  const SurfaceNetwork network = one_vessel();
  const std::vector<BodyRing> rings = body_rings(network);
  ASSERT_EQ(rings.size(), 1U);
  EXPECT_EQ(network.regions[static_cast<std::size_t>(rings[0].region)].kind, RegionKind::kBody);
  EXPECT_EQ(rings[0].strips.size(), network.patches.size());
  EXPECT_EQ(std::set<int>(rings[0].strips.begin(), rings[0].strips.end()).size(),
            rings[0].strips.size());

  for (const int strip : rings[0].strips) {
    EXPECT_EQ(network.patches[static_cast<std::size_t>(strip)].v.control_point_count(),
              continuity_rules::kStripColumns);
  }

  // A ring that is cut open is none.
  SurfaceNetwork open = network;
  open.joins.pop_back();
  EXPECT_TRUE(body_rings(open).empty());
}

TEST(MendBody, MakesSeamsSmoothAndRimsPlaneByAsLittleAsItWasMoved) {
  const SurfaceNetwork clean = one_vessel();
  ASSERT_LT(testing::measure_seams(clean).angle_deg, 1e-5);
  for (const double size_mm : {0.001, 0.02, 0.1}) {
    SurfaceNetwork network = clean;
    Random random(3);
    for (Eigen::Index k = 0; k < network.control_points_mm.size(); ++k) {
      network.control_points_mm.data()[k] += random.uniform(-size_mm, size_mm);
    }
    ASSERT_GT(testing::measure_seams(network).angle_deg, 0.5 * size_mm);
    const Points3 before = network.control_points_mm;
    EXPECT_TRUE(mend_body(network, body_rings(network).front()).empty());  // nothing beyond
    const testing::SeamMeasure after = testing::measure_seams(network);
    EXPECT_LT(after.angle_deg, 1e-5);
    EXPECT_LT(after.gap_mm, 1e-12);
    EXPECT_LT((network.control_points_mm - before).colwise().norm().maxCoeff(), 8 * size_mm);
    for (const Rim& rim : network.rims) {
      for (const Side& side : rim.sides) {
        const auto surface = patch_surface(network, side.patch);
        for (const double t : {0.0, 0.3, 0.8}) {
          const Vec2 uv = side_parameters(network.patches[static_cast<std::size_t>(side.patch)],
                                          side.side, side.from + t * (side.to - side.from));
          EXPECT_NEAR((surface.at(uv.x(), uv.y()) - rim.center_mm).dot(rim.normal), 0, 1e-12);
        }
      }
    }
  }
}

TEST(MendBody, LeavesACleanBodyWhereItIs) {
  const SurfaceNetwork clean = one_vessel();
  SurfaceNetwork network = clean;
  mend_body(network, body_rings(network).front());
  EXPECT_LT((network.control_points_mm - clean.control_points_mm).norm(), 1e-6);
}

}  // namespace
}  // namespace angiospline
