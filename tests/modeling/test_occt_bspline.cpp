#include <cmath>

#include <TColStd_Array1OfInteger.hxx>
#include <TColStd_Array1OfReal.hxx>
#include <TColgp_Array1OfPnt.hxx>
#include <gtest/gtest.h>

#include "kernel/periodic.h"
#include "kernel/rational.h"
#include "kernel/refinement.h"
#include "kernel/reshape.h"
#include "modeling/occt_bspline.h"
#include "tests/kernel/random_splines.h"

namespace angiospline {
namespace {

Eigen::Vector3d vector(const gp_Pnt& p) { return {p.X(), p.Y(), p.Z()}; }
Eigen::Vector3d vector(const gp_Vec& v) { return {v.X(), v.Y(), v.Z()}; }

TEST(OcctBSpline, EvaluatesInsertsAndElevatesAsTheKernelDoes) {
  Random random(1);
  for (int round = 0; round < 60; ++round) {
    const KnotVector knots = random_knots(random, 1 + random.below(7), 0, false);
    const BSplineCurve<3> curve = random_curve<3>(random, knots);
    const Handle(Geom_BSplineCurve) peer = to_occt(curve);
    EXPECT_EQ(from_occt(*peer)->control_points(), curve.control_points());
    const double t = random.uniform(knots.first(), knots.last());
    gp_Pnt point;
    gp_Vec first, second, third;
    peer->D3(t, point, first, second, third);
    EXPECT_LT((vector(point) - curve.at(t)).norm(), 1e-13);
    const auto near = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
      return (a - b).norm() <= 1e-11 * (1 + b.norm());
    };
    EXPECT_TRUE(near(vector(first), curve.at(t, 1)));
    EXPECT_TRUE(near(vector(second), curve.at(t, 2)));
    EXPECT_TRUE(near(vector(third), curve.at(t, 3)));
    peer->IncreaseDegree(knots.degree() + 1);
    EXPECT_LT((from_occt(*peer)->control_points() - elevate(curve).control_points()).norm(), 1e-11);
    const Handle(Geom_BSplineCurve) inserted = to_occt(curve);
    inserted->InsertKnot(t, 1, 0.0);
    EXPECT_LT((from_occt(*inserted)->control_points() - insert_knots(curve, {t})->control_points())
                  .norm(),
              1e-11);
  }
}

TEST(OcctBSpline, PeriodicCurvesGoThereAndComeBackClamped) {
  Random random(2);
  for (int round = 0; round < 40; ++round) {
    const int degree = 2 + random.below(4);
    std::vector<Knot> period;
    double t = 0;
    for (int k = 0; k < degree + 2 + random.below(4); ++k) {
      period.push_back({t, 1 + (random.below(3) == 0 ? 1 : 0)});
      t += random.uniform(0.2, 1);
    }
    const KnotVector knots = *periodic_knots(degree, period, t);
    Eigen::Matrix3Xd points(3, *periodic_count(knots));
    for (Eigen::Index i = 0; i < points.size(); ++i) points.data()[i] = random.uniform(-1, 1);
    const BSplineCurve<3> curve = periodic_curve<3>(knots, points);
    const Handle(Geom_BSplineCurve) peer = periodic_to_occt(curve);
    EXPECT_TRUE(peer->IsPeriodic());
    EXPECT_FALSE(from_occt(*peer));
    const BSplineCurve<4> back = homogeneous_from_occt(*peer);
    for (int k = 0; k < 8; ++k) {
      const double s = random.uniform(0, t);
      EXPECT_LT((vector(peer->Value(s)) - curve.at(s)).norm(), 1e-12);
      EXPECT_LT((back.at(s).head<3>() - curve.at(s)).norm(), 1e-12);
      EXPECT_NEAR(back.at(s)(3), 1, 1e-13);
    }
  }
}

TEST(OcctBSpline, RationalSurfacesSurviveTheRoundTrip) {
  Random random(3);
  const KnotVector u = KnotVector::clamped(2, {0, 1, 2}, 2);
  const KnotVector v = KnotVector::clamped(3, {0, 1, 3});
  Eigen::Matrix4Xd net = random_surface<4>(random, u, v).control_points();
  for (Eigen::Index i = 0; i < net.cols(); ++i) net(3, i) = random.uniform(0.5, 2);
  const BSplineSurface<4> surface(u, v, net);
  const Handle(Geom_BSplineSurface) peer = rational_to_occt(surface);
  const BSplineSurface<4> back = homogeneous_from_occt(*peer);
  EXPECT_EQ(back.u(), u);
  EXPECT_EQ(back.v(), v);
  for (int k = 0; k < 20; ++k) {
    const double a = random.uniform(0, 2);
    const double b = random.uniform(0, 3);
    gp_Pnt point;
    gp_Vec by_u, by_v, by_uu, by_vv, by_uv;
    peer->D2(a, b, point, by_u, by_v, by_uu, by_vv, by_uv);
    const Eigen::Matrix3Xd ours = rational_derivatives<3>(back, a, b, 2);
    EXPECT_LT((ours.col(0) - vector(point)).norm(), 1e-13);
    EXPECT_LT((ours.col(1) - vector(by_u)).norm(), 1e-11 * (1 + ours.col(1).norm()));
    EXPECT_LT((ours.col(4) - vector(by_uv)).norm(), 1e-11 * (1 + ours.col(4).norm()));
  }
}

}  // namespace
}  // namespace angiospline
