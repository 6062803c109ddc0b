#include <cmath>

#include <gtest/gtest.h>

#include "kernel/evaluate/closest_point.h"
#include "kernel/evaluate/grid.h"
#include "kernel/evaluate/rational.h"
#include "kernel/refine/reshape.h"
#include "tests/shapes/random_splines.h"

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

// A single span of high degree can hide narrow valleys between any few samples.
TEST(ClosestPoint, IsProvenGlobalInsideOneSpanOfHighDegree) {
  Random random(4);
  for (int round = 0; round < 60; ++round) {
    const KnotVector knots = KnotVector::bezier(8 + random.below(14));
    Eigen::Matrix2Xd points(2, knots.control_point_count());
    for (int i = 0; i < points.cols(); ++i) {
      points.col(i) << knots.greville(i), (i % 2 == 0 ? 40.0 : -40.0) * random.uniform(0.5, 1);
    }
    const BSplineCurve<2> curve(knots, points);
    const Eigen::Vector2d target(random.uniform(), random.uniform(-0.2, 0.2));
    const auto found = closest_point(curve, target);
    const auto samples = evaluate(curve, spaced(0, 1, 20000));
    EXPECT_LE(found.distance, (samples.colwise() - target).colwise().norm().minCoeff() + 1e-12);
    EXPECT_LE(found.lower_bound, found.distance);
    EXPECT_GE(found.lower_bound * found.lower_bound, found.distance * found.distance - 1e-8);
  }
}

TEST(ClosestPoint, IsProvenOnSurfacesOfHighDegreeToo) {
  Random random(5);
  for (int round = 0; round < 12; ++round) {
    const BSplineSurface<3> surface = random_surface<3>(
        random, KnotVector::bezier(5 + random.below(5)), KnotVector::clamped(5, {0, 0.3, 1}));
    const Eigen::Vector3d target(random.uniform(-1, 1), random.uniform(-1, 1),
                                 random.uniform(-1, 1));
    const auto found = closest_point(surface, target);
    const auto t = spaced(0, 1, 150);
    EXPECT_LE(
        found.distance,
        (evaluate_grid(surface, t, t).points().colwise() - target).colwise().norm().minCoeff() +
            1e-12);
    EXPECT_LE(found.lower_bound, found.distance);
    EXPECT_GE(found.lower_bound * found.lower_bound, found.distance * found.distance - 1e-11);
  }
}

// The unit circle as four rational quarters: from its centre every point is equally near.
TEST(ClosestPoint, OnARationalCircleAndCylinderIsKnown) {
  const double h = std::sqrt(0.5);
  Eigen::Matrix2Xd points(2, 9);
  points << 1, 1, 0, -1, -1, -1, 0, 1, 1, 0, 1, 1, 1, 0, -1, -1, -1, 0;
  Eigen::VectorXd weights(9);
  weights << 1, h, 1, h, 1, h, 1, h, 1;
  const KnotVector knots = KnotVector::clamped(2, {0, 1, 2, 3, 4}, 2);
  const BSplineCurve<3> circle(knots, homogeneous<2>(points, weights));
  Eigen::Matrix4Xd net(4, 18);
  for (int i = 0; i < 9; ++i) {
    const Eigen::Vector3d c = circle.control_points().col(i);
    net.col(2 * i) << c(0), c(1), 0, c(2);
    net.col(2 * i + 1) << c(0), c(1), 5 * c(2), c(2);
  }
  const BSplineSurface<4> cylinder(knots, KnotVector::bezier(1), net);
  Random random(6);
  for (int round = 0; round < 60; ++round) {
    const Eigen::Vector2d q(random.uniform(-2, 2), random.uniform(-2, 2));
    const auto on_circle = closest_point_rational<2>(circle, q);
    EXPECT_NEAR(on_circle.distance, std::abs(q.norm() - 1), 1e-12);
    EXPECT_NEAR(on_circle.lower_bound, on_circle.distance, 1e-5);
    const double z = random.uniform(-1, 6);
    const auto on_wall = closest_point_rational<3>(cylinder, Eigen::Vector3d(q.x(), q.y(), z));
    const double beyond = std::max({0.0, -z, z - 5});
    EXPECT_NEAR(on_wall.distance, std::hypot(q.norm() - 1, beyond), 1e-12);
    EXPECT_NEAR(on_wall.lower_bound, on_wall.distance, 1e-5);
  }
  EXPECT_NEAR(closest_point_rational<2>(circle, Eigen::Vector2d(0, 0)).distance, 1, 1e-15);
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
