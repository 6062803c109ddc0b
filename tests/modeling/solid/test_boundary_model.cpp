#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "modeling/solid/boundary_model.h"
#include "modeling/solid/solid_boundary.h"
#include "modeling/solid/tessellate_solid.h"
#include "tests/shapes/crafted_networks.h"
#include "tests/shapes/sample_networks.h"

namespace angiospline {
namespace {

std::vector<SurfaceNetwork> networks() {
  return {crafted::sheared_tube(1, 6, 1), samples::bent_tube(), crafted::tube_of_quarters(1, 6),
          samples::torus(), crafted::one_patch_tube(1, 5)};
}

TEST(BoundaryModel, OfANetworkAndOfItsSolidAreTheSame) {
  for (const SurfaceNetwork& network : networks()) {
    const auto solid = make_solid(network);
    ASSERT_TRUE(solid) << solid.error().message();
    const auto ours = boundary_of(network);
    const auto theirs = boundary_of(*solid);
    ASSERT_TRUE(ours && theirs);
    EXPECT_EQ(ours->vertex_count, theirs->vertex_count);
    EXPECT_EQ(ours->edges.size(), theirs->edges.size());
    EXPECT_EQ(ours->solids, theirs->solids);
    EXPECT_EQ(ours->shells, theirs->shells);
    EXPECT_TRUE(theirs->is_sound);
    ASSERT_EQ(ours->faces.size(), theirs->faces.size());
    for (std::size_t f = 0; f < ours->faces.size(); ++f) {
      const BoundaryFace &a = ours->faces[f], &b = theirs->faces[f];
      EXPECT_EQ(a.name, b.name);
      EXPECT_EQ(a.kind, b.kind);
      EXPECT_EQ(a.is_whole, b.is_whole);
      ASSERT_EQ(a.plane.has_value(), b.plane.has_value());
      if (a.plane) {
        EXPECT_LT((a.plane->second - b.plane->second).norm(), 1e-12);
      }
      if (a.patch) {
        EXPECT_EQ(a.patch->control_points(), b.patch->control_points());
      }
    }
  }
}

TEST(BoundaryModel, HasEachEdgeOnceEachWayAndOnTheSidesOfItsPatches) {
  int on_sides = 0;
  for (const SurfaceNetwork& network : networks()) {
    const auto model = boundary_of(network);
    ASSERT_TRUE(model);
    for (const BoundaryEdge& edge : model->edges) {
      ASSERT_EQ(edge.uses.size(), 2U);
      EXPECT_NE(edge.uses[0].forward, edge.uses[1].forward);
      EXPECT_EQ(edge.breaks.front(), edge.from);
      EXPECT_EQ(edge.breaks.back(), edge.to);
      for (const EdgeUse& use : edge.uses) {
        if (!use.on_side) continue;
        ++on_sides;
        const BSplineSurface<3>& patch = *model->faces[static_cast<std::size_t>(use.face)].patch;
        for (const double s : {0.0, 0.4, 1.0}) {
          const Vec2 uv =
              side_parameters(patch, use.side, use.side_from + s * (use.side_to - use.side_from));
          const Vec3 at = edge.point(edge.from + s * (edge.to - edge.from)).at;
          EXPECT_LT((patch.at(uv.x(), uv.y()) - at).norm(), 1e-12);
        }
      }
    }
  }
  EXPECT_GT(on_sides, 40);
}

TEST(EdgePoints, HaveTheDerivativeOfTheirCurve) {
  const SurfaceNetwork network = samples::bent_tube();
  for (const PatchSide side : {PatchSide::kU0, PatchSide::kU1, PatchSide::kV0, PatchSide::kV1}) {
    const BSplineCurve<3> curve = side_curve(patch_surface(network, 1), side);
    const auto point = edge_points(curve);
    const double t = 0.4 * curve.knots().last();
    const double h = 1e-6;
    const Vec3 difference = (point(t + h).at - point(t - h).at) / (2 * h);
    EXPECT_LT((point(t).derivative - difference).norm(), 1e-7 * difference.norm());
    EXPECT_EQ(point(t).at, curve.at(t));
  }
}

TEST(BreaksBetween, AreTheEndsAndTheKnotsStrictlyInside) {
  const KnotVector knots = KnotVector::clamped(3, {0, 1, 2, 3});
  EXPECT_EQ(breaks_between(knots, 0.5, 2), (std::vector<double>{0.5, 1, 2}));
  EXPECT_EQ(breaks_between(knots, 0, 3), (std::vector<double>{0, 1, 2, 3}));
  EXPECT_EQ(breaks_between(knots, 1.2, 1.3), (std::vector<double>{1.2, 1.3}));
}

TEST(KindOfRim, IsThatOfTheFaceThatClosesIt) {
  EXPECT_EQ(kind_of_rim(RimKind::kInlet), FaceKind::kInlet);
  EXPECT_EQ(kind_of_rim(RimKind::kOutlet), FaceKind::kOutlet);
  EXPECT_EQ(kind_of_rim(RimKind::kCap), FaceKind::kCap);
}

TEST(TessellateSolid, IsClosedWithThePartsAndTheVolumeOfTheSolid) {
  for (const SurfaceNetwork& network : networks()) {
    const auto solid = make_solid(network);
    ASSERT_TRUE(solid);
    const double exact = samples::exact_volume_mm3(network);
    double before = 1;
    for (const double turn : {0.4, 0.1}) {
      const auto mesh = tessellate(*solid, {.turn_rad = turn});
      ASSERT_TRUE(mesh) << mesh.error().message();
      EXPECT_FALSE(find_defect(*mesh));
      const MeshMeasure m = measure(*mesh);
      EXPECT_TRUE(m.closed());
      // A polygon in a circle whose chords turn by a misses a^2 / 6 of its area; once around the
      // tube and once, on a torus, along it.
      const double error = std::abs(m.volume_mm3 - exact) / exact;
      EXPECT_LT(error, 0.34 * turn * turn);
      EXPECT_LT(error, before);
      before = error;
      for (const Rim& rim : network.rims) {
        EXPECT_TRUE(std::any_of(mesh->parts.begin(), mesh->parts.end(),
                                [&](const MeshPart& part) { return part.name == rim.name; }));
      }
      for (Eigen::Index p = 0; p < mesh->normals.cols(); ++p) {
        EXPECT_NEAR(mesh->normals.col(p).norm(), 1, 1e-12);
      }
    }
  }
}

}  // namespace
}  // namespace angiospline
