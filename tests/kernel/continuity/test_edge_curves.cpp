// Curves along the four sides against the surface itself.
#include <gtest/gtest.h>

#include "kernel/continuity/edge_curves.h"
#include "tests/shapes/random_splines.h"

namespace angiospline {
namespace {

TEST(EdgeCurves, AreTheSurfaceAndItsCrossDerivativesOnEachSide) {
  Random random(1);
  for (int round = 0; round < 20; ++round) {
    const KnotVector u = random_knots(random, 1 + random.below(5), 1);
    const KnotVector v = random_knots(random, 1 + random.below(5), 1);
    const BSplineSurface<3> surface = random_surface<3>(random, u, v);
    for (const SurfaceSide side :
         {SurfaceSide::kU0, SurfaceSide::kU1, SurfaceSide::kV0, SurfaceSide::kV1}) {
      const bool along_v = side == SurfaceSide::kU0 || side == SurfaceSide::kU1;
      const KnotVector& along = along_v ? v : u;
      const KnotVector& across = along_v ? u : v;
      EXPECT_EQ(side_knots(surface, side), along);
      const bool at_first = side == SurfaceSide::kU0 || side == SurfaceSide::kV0;
      const double fixed = at_first ? across.first() : across.last();
      const BSplineCurve<3> H = boundary_curve(surface, side);
      const BSplineCurve<3> F = cross_derivative_curve(surface, side);
      for (int k = 0; k < 10; ++k) {
        const double t = random.uniform(along.first(), along.last());
        const Eigen::Vector3d point = along_v ? surface.at(fixed, t) : surface.at(t, fixed);
        const Eigen::Vector3d slope =
            along_v ? surface.at(fixed, t, 1, 0) : surface.at(t, fixed, 0, 1);
        EXPECT_LT((H.at(t) - point).norm(), 1e-12);
        EXPECT_LT((F.at(t) - slope).norm(), 1e-10 * (1 + slope.norm()));
      }
    }
  }
}

}  // namespace
}  // namespace angiospline
