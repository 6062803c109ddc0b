#include <algorithm>
#include <cmath>

#include <GeomConvert.hxx>
#include <Geom_ToroidalSurface.hxx>
#include <TColStd_Array1OfInteger.hxx>
#include <TColStd_Array1OfReal.hxx>
#include <TColgp_Array1OfPnt.hxx>
#include <gtest/gtest.h>

#include "kernel/evaluate/rational.h"
#include "kernel/refine/periodic.h"
#include "kernel/refine/refinement.h"
#include "kernel/refine/reshape.h"
#include "modeling/solid/occt_bspline.h"
#include "tests/shapes/random_splines.h"

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

// Closed or clamped knots; closed ones with few knots or many, and copies at the seam or not.
KnotVector random_axis(Random& random, bool closed) {
  const int degree = 1 + random.below(5);
  if (!closed) return random_knots(random, degree, 0, false);
  std::vector<Knot> period;
  double t = random.uniform(-2, 2);
  for (int k = 0; k < 2 + random.below(8); ++k) {
    period.push_back({t, 1 + random.below(degree)});
    t += random.uniform(0.2, 1);
  }
  return *periodic_knots(degree, period, t);
}

// Whether the period has the poles that OpenCASCADE needs: then it comes back as it went, and is
// cut finer otherwise.
bool has_enough_poles(const KnotVector& knots, bool closed) {
  return !closed || *periodic_count(knots) >= knots.degree() + 1;
}

// The same period, and its knots inside are among those of the other.
bool is_finer(const KnotVector& fine, const KnotVector& knots) {
  const auto inside = [](const KnotVector& all) {
    std::vector<double> kept;
    for (const double knot : all.knots()) {
      if (knot > all.first() && knot < all.last()) kept.push_back(knot);
    }
    return kept;
  };
  const std::vector<double> more = inside(fine);
  const std::vector<double> fewer = inside(knots);
  return fine.first() == knots.first() && fine.last() == knots.last() &&
         more.size() > fewer.size() &&
         std::includes(more.begin(), more.end(), fewer.begin(), fewer.end());
}

template <int D>
Eigen::Matrix<double, D, Eigen::Dynamic> random_net(Random& random, Eigen::Index count) {
  Eigen::Matrix<double, D, Eigen::Dynamic> net(D, count);
  for (Eigen::Index i = 0; i < net.size(); ++i) net.data()[i] = random.uniform(-1, 1);
  if (D == 4) {
    for (Eigen::Index i = 0; i < count; ++i) net(D - 1, i) = random.uniform(0.5, 2);
  }
  return net;
}

template <int D>
BSplineSurface<D> random_closed_surface(Random& random, bool closed_u, bool closed_v) {
  const KnotVector u = random_axis(random, closed_u);
  const KnotVector v = random_axis(random, closed_v);
  return periodic_surface<D>(
      u, v,
      random_net<D>(random,
                    static_cast<Eigen::Index>(periodic_count(u).value_or(u.control_point_count())) *
                        periodic_count(v).value_or(v.control_point_count())));
}

TEST(OcctBSpline, PeriodicCurvesGoThereAndComeBackTheSame) {
  Random random(2);
  int kept = 0;
  int cut = 0;
  for (int round = 0; round < 80; ++round) {
    const KnotVector knots = random_axis(random, true);
    const bool same = has_enough_poles(knots, true);
    ++(same ? kept : cut);
    const BSplineCurve<3> curve =
        periodic_curve<3>(knots, random_net<3>(random, *periodic_count(knots)));
    const Handle(Geom_BSplineCurve) peer = to_occt(curve);
    EXPECT_TRUE(peer->IsPeriodic());
    EXPECT_GT(peer->NbPoles(), knots.degree());
    const auto back = from_occt(*peer);
    ASSERT_TRUE(back);
    EXPECT_TRUE(is_periodic(*back));
    if (same) {
      EXPECT_EQ(peer->NbPoles(), *periodic_count(knots));
      EXPECT_EQ(back->knots(), knots);
      EXPECT_EQ(back->control_points(), curve.control_points());
    } else {
      EXPECT_TRUE(is_finer(back->knots(), knots));
    }
    const BSplineCurve<4> rational(
        knots,
        periodic_curve<4>(knots, random_net<4>(random, *periodic_count(knots))).control_points());
    const Handle(Geom_BSplineCurve) rational_peer = rational_to_occt(rational);
    EXPECT_TRUE(rational_peer->IsPeriodic());
    EXPECT_FALSE(from_occt(*rational_peer));
    const BSplineCurve<4> again = homogeneous_from_occt(*rational_peer);
    EXPECT_TRUE(is_periodic(again));
    if (same) {
      EXPECT_EQ(again.knots(), knots);
      EXPECT_LT((again.control_points() - rational.control_points()).cwiseAbs().maxCoeff(), 1e-15);
    }
    for (int k = 0; k < 8; ++k) {
      const double s = random.uniform(knots.first(), knots.last());
      EXPECT_LT((vector(peer->Value(s)) - curve.at(s)).norm(), 1e-12);
      gp_Pnt point;
      gp_Vec first, second;
      rational_peer->D2(s, point, first, second);
      const Eigen::Matrix3Xd ours = rational_derivatives<3>(rational, s, 2);
      EXPECT_LT((vector(point) - ours.col(0)).norm(), 1e-12);
      EXPECT_LT((vector(first) - ours.col(1)).norm(), 1e-10 * (1 + ours.col(1).norm()));
    }
  }
  EXPECT_GT(kept, 40);
  EXPECT_GT(cut, 0);
}

// Closed along u, along v, in both and in neither; polynomial and rational.
TEST(OcctBSpline, PeriodicSurfacesGoThereAndComeBackTheSame) {
  Random random(4);
  int periodic = 0;
  int kept = 0;
  int cut = 0;
  for (int round = 0; round < 80; ++round) {
    const bool closed_u = (round & 1) != 0;
    const bool closed_v = (round & 2) != 0;
    const BSplineSurface<3> s = random_closed_surface<3>(random, closed_u, closed_v);
    const Handle(Geom_BSplineSurface) peer = to_occt(s);
    EXPECT_EQ(peer->IsUPeriodic(), closed_u);
    EXPECT_EQ(peer->IsVPeriodic(), closed_v);
    const auto back = from_occt(*peer);
    ASSERT_TRUE(back);
    const bool same = has_enough_poles(s.u(), closed_u) && has_enough_poles(s.v(), closed_v);
    if (same) {
      EXPECT_EQ(back->u(), s.u());
      EXPECT_EQ(back->v(), s.v());
      EXPECT_EQ(back->control_points(), s.control_points());
      ++kept;
    } else {
      EXPECT_TRUE(has_enough_poles(s.u(), closed_u) || is_finer(back->u(), s.u()));
      EXPECT_TRUE(has_enough_poles(s.v(), closed_v) || is_finer(back->v(), s.v()));
      ++cut;
    }
    const BSplineSurface<4> rational = random_closed_surface<4>(random, closed_u, closed_v);
    const Handle(Geom_BSplineSurface) rational_peer = rational_to_occt(rational);
    EXPECT_FALSE(from_occt(*rational_peer));
    const BSplineSurface<4> again = homogeneous_from_occt(*rational_peer);
    EXPECT_EQ(is_periodic_u(again), closed_u);
    EXPECT_EQ(is_periodic_v(again), closed_v);
    if (has_enough_poles(rational.u(), closed_u) && has_enough_poles(rational.v(), closed_v)) {
      EXPECT_EQ(again.u(), rational.u());
      EXPECT_EQ(again.v(), rational.v());
      EXPECT_LT((again.control_points() - rational.control_points()).cwiseAbs().maxCoeff(), 1e-15);
    }
    for (int k = 0; k < 8; ++k) {
      const double a = random.uniform(s.u().first(), s.u().last());
      const double b = random.uniform(s.v().first(), s.v().last());
      EXPECT_LT((vector(peer->Value(a, b)) - s.at(a, b)).norm(), 1e-12);
      const double c = random.uniform(rational.u().first(), rational.u().last());
      const double d = random.uniform(rational.v().first(), rational.v().last());
      gp_Pnt point;
      gp_Vec by_u, by_v;
      rational_peer->D1(c, d, point, by_u, by_v);
      const Eigen::Matrix3Xd ours = rational_derivatives<3>(rational, c, d, 1);
      EXPECT_LT((vector(point) - ours.col(0)).norm(), 1e-12);
      EXPECT_LT((vector(by_u) - ours.col(1)).norm(), 1e-10 * (1 + ours.col(1).norm()));
      EXPECT_LT((vector(by_v) - ours.col(2)).norm(), 1e-10 * (1 + ours.col(2).norm()));
    }
    periodic += closed_u || closed_v ? 1 : 0;
  }
  EXPECT_EQ(periodic, 60);
  EXPECT_GT(kept, 40);
  EXPECT_GT(cut, 2);
}

// What OpenCASCADE itself makes periodic: a full turn of a profile, the circle as a spline.
TEST(OcctBSpline, ItsOwnPeriodicSurfacesComeAcross) {
  const Handle(Geom_Surface) round = new Geom_ToroidalSurface(gp_Ax3(), 5, 2);
  const Handle(Geom_BSplineSurface) torus = GeomConvert::SurfaceToBSplineSurface(round);
  const BSplineSurface<4> ours = homogeneous_from_occt(*torus);
  EXPECT_EQ(is_periodic_u(ours), torus->IsUPeriodic() == Standard_True);
  EXPECT_EQ(is_periodic_v(ours), torus->IsVPeriodic() == Standard_True);
  EXPECT_TRUE(torus->IsUPeriodic() && torus->IsVPeriodic());
  Random random(5);
  for (int k = 0; k < 50; ++k) {
    const double u = random.uniform(ours.u().first(), ours.u().last());
    const double v = random.uniform(ours.v().first(), ours.v().last());
    const Eigen::Vector3d p = rational_derivatives<3>(ours, u, v, 0).col(0);
    EXPECT_LT((vector(torus->Value(u, v)) - p).norm(), 1e-12);
    EXPECT_NEAR(std::hypot(std::hypot(p.x(), p.y()) - 5, p.z()), 2, 1e-12);
  }
  // Elevated there and here, and with a knot inserted there and here.
  const Handle(Geom_BSplineSurface) raised = Handle(Geom_BSplineSurface)::DownCast(torus->Copy());
  raised->IncreaseDegree(3, 4);
  const BSplineSurface<4> ours_raised = elevate(ours, 3 - ours.u().degree(), 4 - ours.v().degree());
  EXPECT_LT((homogeneous_from_occt(*raised).control_points() - ours_raised.control_points())
                .cwiseAbs()
                .maxCoeff(),
            1e-11);
  const double at = 0.3 * ours.u().first() + 0.7 * ours.u().last();
  const Handle(Geom_BSplineSurface) finer = Handle(Geom_BSplineSurface)::DownCast(torus->Copy());
  finer->InsertUKnot(at, 1, 0.0);
  EXPECT_LT((homogeneous_from_occt(*finer).control_points() -
             insert_knots_periodic_u(ours, {at})->control_points())
                .cwiseAbs()
                .maxCoeff(),
            1e-12);
}

TEST(OcctBSpline, FloatingEndsStayFloating) {
  Random random(6);
  int floating = 0;
  for (int round = 0; round < 40; ++round) {
    const KnotVector knots = random_knots(random, 1 + random.below(5));
    const BSplineCurve<3> curve = random_curve<3>(random, knots);
    const Handle(Geom_BSplineCurve) peer = to_occt(curve);
    EXPECT_EQ(from_occt(*peer)->knots(), knots);
    EXPECT_EQ(from_occt(*peer)->control_points(), curve.control_points());
    const double t = random.uniform(knots.first(), knots.last());
    EXPECT_LT((vector(peer->Value(t)) - curve.at(t)).norm(), 1e-12);
    floating += knots.knots().front() < knots.first() ? 1 : 0;
  }
  EXPECT_GT(floating, 5);
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
