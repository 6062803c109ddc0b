#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "kernel/evaluate/grid.h"
#include "kernel/refine/control_mesh.h"
#include "kernel/refine/periodic.h"
#include "kernel/refine/refinement.h"
#include "kernel/refine/reshape.h"
#include "kernel/refine/split.h"
#include "tests/shapes/random_splines.h"

namespace angiospline {
namespace {

std::vector<Knot> random_period(Random& random, int degree, int count) {
  std::vector<Knot> knots;
  double t = random.uniform(-1, 1);
  for (int k = 0; k < count; ++k) {
    knots.push_back({t, 1 + random.below(degree)});
    t += random.uniform(0.1, 1);
  }
  return knots;
}

BSplineCurve<3> random_closed(Random& random) {
  const int degree = 1 + random.below(5);
  const auto period = random_period(random, degree, 1 + random.below(7));
  const KnotVector knots =
      *periodic_knots(degree, period, period.back().value + random.uniform(0.1, 1));
  Eigen::Matrix3Xd points(3, *periodic_count(knots));
  for (Eigen::Index i = 0; i < points.size(); ++i) points.data()[i] = random.uniform(-1, 1);
  return periodic_curve<3>(knots, points);
}

TEST(PeriodicKnots, CountTheMultiplicitiesOfOnePeriod) {
  Random random(1);
  for (int round = 0; round < 200; ++round) {
    const int degree = 1 + random.below(6);
    const auto period = random_period(random, degree, 1 + random.below(8));
    int total = 0;
    for (const Knot& knot : period) total += knot.multiplicity;
    const double end = period.back().value + 0.7;
    const auto knots = periodic_knots(degree, period, end);
    ASSERT_TRUE(knots) << knots.error().message();
    EXPECT_EQ(knots->first(), period.front().value);
    EXPECT_EQ(knots->last(), end);
    ASSERT_TRUE(periodic_count(*knots));
    EXPECT_EQ(*periodic_count(*knots), total);
  }
  EXPECT_FALSE(periodic_knots(3, {{0, 4}}, 1));
  EXPECT_FALSE(periodic_knots(3, {}, 1));
  EXPECT_FALSE(periodic_knots(3, {{0, 1}, {1, 1}}, 1));
  EXPECT_FALSE(periodic_count(KnotVector::clamped(3, {0, 1, 2})));
}

TEST(PeriodicCurve, JoinsItselfWithTheContinuityOfItsFirstKnot) {
  Random random(2);
  for (int round = 0; round < 200; ++round) {
    const BSplineCurve<3> curve = random_closed(random);
    EXPECT_TRUE(is_periodic(curve));
    const KnotVector& k = curve.knots();
    const int continuity = k.degree() - k.multiplicity(k.first());
    for (int d = 0; d <= continuity; ++d) {
      const Eigen::Vector3d start = curve.at(k.first(), d);
      EXPECT_LT((start - curve.at(k.last(), d)).norm(), 1e-10 * (1 + start.norm()));
    }
  }
}

TEST(PeriodicCurve, InsertionKeepsItClosedAndChangesNoPoint) {
  Random random(3);
  for (int round = 0; round < 100; ++round) {
    const BSplineCurve<3> curve = random_closed(random);
    const KnotVector& k = curve.knots();
    std::vector<double> added{k.first() + 0.3 * (k.last() - k.first()),
                              k.first() + 0.77 * (k.last() - k.first())};
    if (k.multiplicity(k.first()) < k.degree()) added.push_back(k.last());
    const auto fine = insert_knots_periodic(curve, added);
    ASSERT_TRUE(fine) << fine.error().message();
    EXPECT_TRUE(is_periodic(*fine));
    EXPECT_EQ(*periodic_count(fine->knots()), *periodic_count(k) + static_cast<int>(added.size()));
    for (int i = 0; i < 10; ++i) {
      const double t = random.uniform(k.first(), k.last());
      EXPECT_LT((fine->at(t) - curve.at(t)).norm(), 1e-12);
    }
  }
}

TEST(PeriodicCurve, ClampedAndUnclampedAgainIsItself) {
  Random random(4);
  for (int round = 0; round < 100; ++round) {
    const BSplineCurve<3> curve = random_closed(random);
    const BSplineCurve<3> clamped = restrict_to(curve, curve.knots().first(), curve.knots().last());
    EXPECT_EQ(clamped.knots().multiplicity(clamped.knots().first()), clamped.knots().order());
    const double t = random.uniform(curve.knots().first(), curve.knots().last());
    EXPECT_LT((clamped.at(t) - curve.at(t)).norm(), 1e-13);
    const BSplineCurve<3> again = rewrite(clamped, curve.knots());
    EXPECT_LT((again.control_points() - curve.control_points()).cwiseAbs().maxCoeff(), 1e-8);
  }
}

KnotVector random_closed_knots(Random& random) {
  const int degree = 1 + random.below(4);
  const auto period = random_period(random, degree, 1 + random.below(6));
  return *periodic_knots(degree, period, period.back().value + random.uniform(0.1, 1));
}

// Closed along u, v or both.
BSplineSurface<3> random_closed_surface(Random& random, bool closed_u, bool closed_v) {
  const KnotVector u =
      closed_u ? random_closed_knots(random) : random_knots(random, 1 + random.below(4), 0, false);
  const KnotVector v =
      closed_v ? random_closed_knots(random) : random_knots(random, 1 + random.below(4), 0, false);
  Eigen::Matrix3Xd net(
      3, static_cast<Eigen::Index>(periodic_count(u).value_or(u.control_point_count())) *
             periodic_count(v).value_or(v.control_point_count()));
  for (Eigen::Index i = 0; i < net.size(); ++i) net.data()[i] = random.uniform(-1, 1);
  return periodic_surface<3>(u, v, net);
}

TEST(PeriodicCurve, StaysClosedWhenElevatedReversedShiftedAndDifferentiated) {
  Random random(6);
  int derivatives = 0;
  for (int round = 0; round < 100; ++round) {
    const BSplineCurve<3> curve = random_closed(random);
    const KnotVector& k = curve.knots();
    const int by = 1 + random.below(3);
    const BSplineCurve<3> raised = elevate(curve, by);
    EXPECT_TRUE(is_periodic(raised));
    EXPECT_EQ(raised.knots().degree(), k.degree() + by);
    EXPECT_EQ(raised.knots().multiplicity(k.first()), k.multiplicity(k.first()) + by);
    EXPECT_TRUE(is_periodic(reverse(curve)));
    EXPECT_TRUE(is_periodic(over(curve, 2, 5)));
    const BSplineCurve<3> slope = derivative(curve);
    const bool corner = k.multiplicity(k.first()) == k.degree();
    EXPECT_EQ(is_periodic(slope), !corner);
    derivatives += corner ? 0 : 1;
    for (int i = 0; i < 10; ++i) {
      const double t = random.uniform(k.first(), k.last());
      EXPECT_LT((raised.at(t) - curve.at(t)).norm(), 1e-12);
      EXPECT_LT((slope.at(t) - curve.at(t, 1)).norm(), 1e-10 * (1 + slope.at(t).norm()));
    }
  }
  EXPECT_GT(derivatives, 20);
}

TEST(PeriodicCurve, MayBeginAnywhere) {
  Random random(7);
  for (int round = 0; round < 100; ++round) {
    const BSplineCurve<3> curve = random_closed(random);
    const KnotVector& k = curve.knots();
    const double period = k.last() - k.first();
    const double start = random_parameter(random, k);
    const BSplineCurve<3> turned = with_seam(curve, start);
    EXPECT_TRUE(is_periodic(turned));
    EXPECT_EQ(turned.knots().first(), start);
    EXPECT_EQ(turned.knots().last(), start + period);
    for (int i = 0; i < 10; ++i) {
      const double t = random.uniform(start, start + period);
      const Eigen::Vector3d wanted = curve.at(t > k.last() ? t - period : t);
      EXPECT_LT((turned.at(t) - wanted).norm(), 1e-11);
    }
  }
}

TEST(PeriodicCurve, CompatibleClosedCurvesAreClosed) {
  Random random(8);
  for (int round = 0; round < 30; ++round) {
    const std::vector<BSplineCurve<3>> curves{random_closed(random), random_closed(random),
                                              random_closed(random)};
    const auto compatible = make_compatible(curves);
    const KnotVector& common = compatible.front().knots();
    for (std::size_t k = 0; k < curves.size(); ++k) {
      EXPECT_TRUE(is_periodic(compatible[k]));
      EXPECT_EQ(compatible[k].knots(), common);
      const KnotVector& own = curves[k].knots();
      const double s = random.uniform(0.01, 0.99);
      EXPECT_LT((compatible[k].at(common.first() + s * (common.last() - common.first())) -
                 curves[k].at(own.first() + s * (own.last() - own.first())))
                    .norm(),
                1e-8);
    }
  }
}

TEST(PeriodicCurve, RefinedToAToleranceStaysClosed) {
  const double turn = 2 * std::numbers::pi;
  const KnotVector knots = *periodic_knots(3, {{0, 1}, {1, 1}, {2, 1}, {3, 1}, {4, 1}}, 5);
  Eigen::Matrix2Xd points(2, 5);
  for (int i = 0; i < 5; ++i) points.col(i) << std::cos(turn * i / 5), std::sin(turn * i / 5);
  const BSplineCurve<2> curve = periodic_curve<2>(knots, points);
  MeshOptions options;
  options.tolerance = 1e-3;
  const auto fine = refine_to_tolerance(curve, options);
  ASSERT_TRUE(fine) << fine.error().message();
  EXPECT_TRUE(is_periodic(fine->curve));
  EXPECT_LE(fine->distance, 1e-3);
  for (const double t : spaced(0, 5, 60))
    EXPECT_LT((fine->curve.at(t) - curve.at(t)).norm(), 1e-14);
}

TEST(PeriodicSurface, StaysClosedInEitherDirectionWhateverIsDoneToIt) {
  Random random(9);
  for (int round = 0; round < 60; ++round) {
    const bool closed_u = round % 3 != 0;
    const bool closed_v = round % 3 != 1;
    const BSplineSurface<3> s = random_closed_surface(random, closed_u, closed_v);
    const auto expect_closed = [&](const BSplineSurface<3>& of, const char* what) {
      EXPECT_EQ(is_periodic_u(of), closed_u) << what;
      EXPECT_EQ(is_periodic_v(of), closed_v) << what;
    };
    expect_closed(s, "itself");
    expect_closed(elevate(s, 1, 2), "elevated");
    expect_closed(reverse_u(reverse_v(s)), "reversed");
    EXPECT_EQ(is_periodic_u(swap_uv(s)), closed_v);
    BSplineSurface<3> fine = s;
    const double a = s.u().first() + 0.37 * (s.u().last() - s.u().first());
    const double b = s.v().first() + 0.81 * (s.v().last() - s.v().first());
    if (closed_u) fine = *insert_knots_periodic_u(fine, {a});
    if (closed_v) fine = *insert_knots_periodic_v(fine, {b});
    expect_closed(fine, "refined");
    EXPECT_GT(fine.control_points().cols(), s.control_points().cols());
    const BSplineSurface<3> raised = elevate(s, 2, 1);
    for (int k = 0; k < 10; ++k) {
      const double u = random.uniform(s.u().first(), s.u().last());
      const double v = random.uniform(s.v().first(), s.v().last());
      EXPECT_LT((fine.at(u, v) - s.at(u, v)).norm(), 1e-12);
      EXPECT_LT((raised.at(u, v) - s.at(u, v)).norm(), 1e-12);
      if (closed_u) {
        EXPECT_LT((s.at(s.u().first(), v) - s.at(s.u().last(), v)).norm(), 1e-12);
      }
      if (closed_v) {
        EXPECT_LT((s.at(u, s.v().first()) - s.at(u, s.v().last())).norm(), 1e-12);
      }
    }
  }
}

TEST(FitPeriodic, PutsATorusOnItsPointsAndNamesTheDirectionThatFails) {
  const double turn = 2 * std::numbers::pi;
  const auto circle_knots = [&](int count) {
    std::vector<Knot> period;
    for (int k = 0; k < count; ++k) period.push_back({turn * k / count, 1});
    return *periodic_knots(5, period, turn);
  };
  const KnotVector u = circle_knots(14);
  const KnotVector v = circle_knots(12);
  std::vector<double> us, vs;
  for (int i = 0; i < 50; ++i) us.push_back(turn * i / 50);
  for (int j = 0; j < 40; ++j) vs.push_back(turn * j / 40);
  Eigen::Matrix3Xd points(3, 2000);
  for (int i = 0; i < 50; ++i) {
    for (int j = 0; j < 40; ++j) {
      const double a = us[static_cast<std::size_t>(i)];
      const double b = vs[static_cast<std::size_t>(j)];
      const double r = 3 + std::cos(b);
      points.col(i * 40 + j) << r * std::cos(a), r * std::sin(a), std::sin(b);
    }
  }
  const auto torus = fit_periodic<3>(u, v, us, vs, points);
  ASSERT_TRUE(torus) << torus.error().message();
  EXPECT_TRUE(is_periodic_u(*torus));
  EXPECT_TRUE(is_periodic_v(*torus));
  const auto grid = evaluate_grid(*torus, spaced(0, turn, 60), spaced(0, turn, 60));
  for (Eigen::Index k = 0; k < grid.points().cols(); ++k) {
    const Eigen::Vector3d p = grid.points().col(k);
    EXPECT_NEAR(std::hypot(std::hypot(p.x(), p.y()) - 3, p.z()), 1, 1e-5);
  }
  // Closed along u alone: a tube, clamped along v.
  const KnotVector straight = KnotVector::clamped(3, {0, 2, 4, turn});
  const auto tube = fit_periodic<3>(u, straight, us, vs, points);
  ASSERT_TRUE(tube) << tube.error().message();
  EXPECT_TRUE(is_periodic_u(*tube));
  EXPECT_FALSE(is_periodic_v(*tube));
  const auto few = fit_periodic<3>(u, v, us, spaced(0, 1, 40), points);
  ASSERT_FALSE(few);
  EXPECT_NE(few.error().message().find("v direction"), std::string::npos);
  EXPECT_FALSE(fit_periodic<3>(straight, straight, us, vs, points));
}

TEST(FitPeriodic, PutsAClosedQuinticOnACircle) {
  const double turn = 2 * std::numbers::pi;
  std::vector<Knot> period;
  for (int k = 0; k < 12; ++k) period.push_back({turn * k / 12, 1});
  const KnotVector knots = *periodic_knots(5, period, turn);
  std::vector<double> parameters;
  Eigen::Matrix2Xd points(2, 100);
  for (int i = 0; i < 100; ++i) {
    parameters.push_back(turn * i / 100);
    points.col(i) << std::cos(parameters.back()), std::sin(parameters.back());
  }
  const auto circle = fit_periodic<2>(knots, parameters, points);
  ASSERT_TRUE(circle) << circle.error().message();
  EXPECT_TRUE(is_periodic(*circle));
  for (const double t : spaced(0, turn, 500)) EXPECT_NEAR(circle->at(t).norm(), 1, 1e-6);
  const auto bad = fit_periodic<2>(knots, spaced(0, 1, 100), points);
  EXPECT_FALSE(bad);
}

TEST(FitPeriodic, InterpolatesWithAsManyPointsAsUnknowns) {
  Random random(5);
  const KnotVector knots = *periodic_knots(3, {{0, 1}, {1, 1}, {1.5, 1}, {3, 1}, {4, 1}}, 5);
  const std::vector<double> parameters{0.1, 1.2, 2.0, 3.2, 4.4};
  const Eigen::Matrix2Xd points = Eigen::Matrix2Xd::Random(2, 5);
  const auto curve = fit_periodic<2>(knots, parameters, points);
  ASSERT_TRUE(curve) << curve.error().message();
  EXPECT_LT((evaluate(*curve, parameters) - points).cwiseAbs().maxCoeff(), 1e-12);
}

}  // namespace
}  // namespace angiospline
