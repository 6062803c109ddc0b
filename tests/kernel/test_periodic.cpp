#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "kernel/grid.h"
#include "kernel/periodic.h"
#include "kernel/refinement.h"
#include "kernel/split.h"
#include "tests/kernel/random_splines.h"

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
