#include <cmath>

#include <gtest/gtest.h>

#include "kernel/closest_point.h"
#include "kernel/grid.h"
#include "tests/kernel/random_splines.h"

namespace angiospline {
namespace {

TEST(ClosestPointOnCurve, IsNeverFartherThanTheBestOfManySamples) {
  Random random(1);
  for (int round = 0; round < 60; ++round) {
    const KnotVector knots = random_knots(random, 2 + random.below(4), 2);
    const BSplineCurve<3> curve = random_curve<3>(random, knots);
    const Eigen::Vector3d target(random.uniform(-1, 1), random.uniform(-1, 1),
                                 random.uniform(-1, 1));
    const CurvePoint<3> found = closest_point(curve, target);
    EXPECT_NEAR((curve.at(found.t) - target).norm(), found.distance, 1e-14);
    const auto samples = evaluate(curve, spaced(knots.first(), knots.last(), 2000));
    EXPECT_LE(found.distance, (samples.colwise() - target).colwise().norm().minCoeff() + 1e-12);
  }
}

TEST(ClosestPointOnSurface, IsNeverFartherThanTheBestOfManySamples) {
  Random random(2);
  for (int round = 0; round < 30; ++round) {
    const KnotVector u = random_knots(random, 2 + random.below(3), 1);
    const KnotVector v = random_knots(random, 2 + random.below(3), 1);
    const BSplineSurface<3> surface = random_surface<3>(random, u, v);
    const Eigen::Vector3d target(random.uniform(-1, 1), random.uniform(-1, 1),
                                 random.uniform(-1, 1));
    const SurfacePoint<3> found = closest_point(surface, target);
    EXPECT_NEAR((surface.at(found.u, found.v) - target).norm(), found.distance, 1e-14);
    const auto samples =
        evaluate_grid(surface, spaced(u.first(), u.last(), 60), spaced(v.first(), v.last(), 60))
            .points();
    EXPECT_LE(found.distance, (samples.colwise() - target).colwise().norm().minCoeff() + 1e-12);
  }
}

TEST(ClosestPointOnSurface, FindsTheFootOfANormal) {
  Random random(3);
  const KnotVector knots = KnotVector::clamped(3, {0, 1, 2, 3});
  Eigen::Matrix3Xd net(3, 36);
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) net.col(i * 6 + j) << i, j, 0.2 * random.uniform();
  }
  const BSplineSurface<3> surface(knots, knots, net);
  for (int k = 0; k < 50; ++k) {
    const double u = random.uniform(0.1, 2.9);
    const double v = random.uniform(0.1, 2.9);
    const Eigen::Vector3d normal = normal_vector(surface, u, v).normalized();
    const auto found = closest_point<3>(surface, surface.at(u, v) + 0.2 * normal);
    EXPECT_NEAR(found.u, u, 1e-7);
    EXPECT_NEAR(found.v, v, 1e-7);
    EXPECT_NEAR(found.distance, 0.2, 1e-13);
  }
}

TEST(ClosestPointOnSurface, StopsAtTheBoundary) {
  const KnotVector knots = KnotVector::bezier(1);
  Eigen::Matrix3Xd net(3, 4);
  net << 0, 0, 1, 1, 0, 1, 0, 1, 0, 0, 0, 0;
  const BSplineSurface<3> square(knots, knots, net);
  const auto found = closest_point<3>(square, Eigen::Vector3d(2, 0.25, 0));
  EXPECT_DOUBLE_EQ(found.u, 1);
  EXPECT_DOUBLE_EQ(found.v, 0.25);
  EXPECT_DOUBLE_EQ(found.distance, 1);
}

}  // namespace
}  // namespace angiospline
