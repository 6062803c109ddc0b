#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "kernel/evaluate/curvature.h"
#include "kernel/evaluate/rational.h"
#include "tests/shapes/random_splines.h"

namespace angiospline {
namespace {

const KnotVector kCircleKnots = KnotVector::clamped(2, {0, 1, 2, 3, 4}, 2);

// The unit circle as four rational quadratic quarters, homogeneous.
Eigen::Matrix3Xd circle() {
  const double h = std::sqrt(0.5);
  Eigen::Matrix2Xd points(2, 9);
  points << 1, 1, 0, -1, -1, -1, 0, 1, 1, 0, 1, 1, 1, 0, -1, -1, -1, 0;
  Eigen::VectorXd weights(9);
  weights << 1, h, 1, h, 1, h, 1, h, 1;
  return homogeneous<2>(points, weights);
}

// u round the tube, v round the axis; radius R of the axis, r of the tube.
BSplineSurface<4> torus(double R, double r) {
  const Eigen::Matrix3Xd c = circle();
  Eigen::Matrix4Xd net(4, 81);
  for (int i = 0; i < 9; ++i) {
    for (int j = 0; j < 9; ++j) {
      const double wu = c(2, i);
      const double wv = c(2, j);
      const double radial = (R * wu + r * c(0, i));  // times wu
      net.col(i * 9 + j) << radial * c(0, j), radial * c(1, j), r * c(1, i) * wv, wu * wv;
    }
  }
  return BSplineSurface<4>(kCircleKnots, kCircleKnots, net);
}

TEST(Rational, CircleHasRadiusAndCurvatureOneEverywhere) {
  const BSplineCurve<3> curve(kCircleKnots, circle());
  Random random(1);
  for (int k = 0; k < 100; ++k) {
    const auto d = rational_derivatives<2>(curve, random.uniform(0, 4), 2);
    EXPECT_NEAR(d.col(0).norm(), 1, 4e-16);
    const double cross = d(0, 1) * d(1, 2) - d(1, 1) * d(0, 2);
    EXPECT_NEAR(cross / std::pow(d.col(1).norm(), 3), 1, 1e-13);
  }
}

TEST(Rational, DerivativesAgreeWithFiniteDifferencesToThirdOrder) {
  Random random(2);
  const BSplineSurface<4> s = torus(3, 1);
  const double h = 1e-4;
  for (int k = 0; k < 20; ++k) {
    const double u = random.below(4) + random.uniform(0.1, 0.9);
    const double v = random.below(4) + random.uniform(0.1, 0.9);
    const auto at = [&](double a, double b) { return rational_derivatives<3>(s, a, b, 3); };
    const Eigen::Matrix3Xd d = at(u, v);
    const Eigen::Matrix3Xd du = (at(u + h, v) - at(u - h, v)) / (2 * h);
    const Eigen::Matrix3Xd dv = (at(u, v + h) - at(u, v - h)) / (2 * h);
    // Columns: 0 S, 1 u, 2 v, 3 uu, 4 uv, 5 vv, 6 uuu, 7 uuv, 8 uvv, 9 vvv.
    const int by_u[] = {1, 3, 4, 6, 7, 8};
    const int by_v[] = {2, 4, 5, 7, 8, 9};
    for (int c = 0; c < 6; ++c) {
      EXPECT_LT((d.col(by_u[c]) - du.col(c)).norm(), 1e-5);
      EXPECT_LT((d.col(by_v[c]) - dv.col(c)).norm(), 1e-5);
    }
  }
}

TEST(PrincipalCurvatures, OfATorusAreKnownEverywhere) {
  const double R = 3;
  const double r = 1;
  const BSplineSurface<4> s = torus(R, r);
  Random random(3);
  for (int k = 0; k < 100; ++k) {
    const SurfaceJet jet = surface_jet(s, random.uniform(0, 4), random.uniform(0, 4));
    const double from_axis = std::hypot(jet.point.x(), jet.point.y());
    const double cosine = (from_axis - R) / r;  // of the angle round the tube
    const Vec3 from_tube_axis = jet.point - R / from_axis * Vec3(jet.point.x(), jet.point.y(), 0);
    const double sign = fundamental_forms(jet).normal.dot(from_tube_axis) > 0 ? -1 : 1;
    const PrincipalCurvatures c = principal_curvatures(jet);
    const double around = sign * cosine / from_axis;
    const double tube = sign / r;
    EXPECT_NEAR(c.mean(), 0.5 * (around + tube), 1e-12);
    EXPECT_NEAR(c.gauss(), around * tube, 1e-12);
    EXPECT_NEAR(c.largest_direction.dot(c.smallest_direction), 0, 1e-14);
    EXPECT_NEAR(c.largest_direction.dot(fundamental_forms(jet).normal), 0, 1e-14);
    // Round the axis the direction is horizontal; round the tube it lies in the meridian plane.
    const Vec3 meridian = sign > 0 ? c.largest_direction : c.smallest_direction;
    const Vec3 axis_direction(-jet.point.y(), jet.point.x(), 0);
    EXPECT_NEAR(meridian.dot(axis_direction), 0, 1e-10);
  }
}

TEST(PrincipalCurvatures, DoNotDependOnTheParametrisation) {
  // A paraboloid z = (a x^2 + b y^2) / 2 in skewed parameters.
  const double a = 0.7;
  const double b = -0.4;
  SurfaceJet jet;
  jet.point = Vec3::Zero();
  jet.u = Vec3(2, 0, 0);
  jet.v = Vec3(3, 0.5, 0);
  jet.uu = Vec3(0, 0, a * 4);
  jet.uv = Vec3(0, 0, a * 6);
  jet.vv = Vec3(0, 0, a * 9 + b * 0.25);
  const PrincipalCurvatures c = principal_curvatures(jet);
  EXPECT_NEAR(c.largest, a, 1e-13);
  EXPECT_NEAR(c.smallest, b, 1e-13);
  EXPECT_NEAR(std::abs(c.largest_direction.x()), 1, 1e-13);
}

TEST(FundamentalForms, OfASingularPointSaySoAndAreZero) {
  SurfaceJet jet{Vec3::Zero(),  Vec3(1, 2, 3), Vec3(2, 4, 6),
                 Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)};
  EXPECT_FALSE(fundamental_forms(jet).regular);
  EXPECT_EQ(principal_curvatures(jet).largest, 0);
  jet.v.setZero();
  EXPECT_FALSE(fundamental_forms(jet).regular);
}

TEST(Curvature, OfATwistedCubicIsKnown) {
  // (t, t^2, t^3): curvature 2 sqrt(1 + 9 t^2 + 9 t^4) / (1 + 4 t^2 + 9 t^4)^1.5, torsion
  // 3 / (1 + 9 t^2 + 9 t^4).
  Eigen::Matrix3Xd points(3, 4);
  points << 0, 1. / 3, 2. / 3, 1, 0, 0, 1. / 3, 1, 0, 0, 0, 1;
  const BSplineCurve<3> curve(KnotVector::bezier(3), points);
  for (const double t : {0.0, 0.3, 0.8, 1.0}) {
    const double q = 1 + 9 * t * t + 9 * std::pow(t, 4);
    EXPECT_NEAR(curvature(curve, t),
                2 * std::sqrt(q) / std::pow(1 + 4 * t * t + 9 * std::pow(t, 4), 1.5), 1e-13);
    EXPECT_NEAR(torsion(curve, t), 3 / q, 1e-12);
  }
}

}  // namespace
}  // namespace angiospline
