// One branch: its samples, its radii, the rules its path keeps to, and the smoother that puts them
// together.
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "base/index.h"
#include "base/random.h"
#include "modeling/tree/branch_radii.h"
#include "modeling/tree/branch_rules.h"
#include "modeling/tree/branch_samples.h"
#include "modeling/tree/branch_smoother.h"
#include "modeling/tree/keep_apart.h"
#include "modeling/tree/rules.h"

namespace angiospline {
namespace {

CenterlineBranch line_of(const std::vector<Vec3>& points, const std::vector<double>& radii) {
  CenterlineBranch branch;
  branch.name = "b";
  const auto count = static_cast<Eigen::Index>(points.size());
  branch.points_mm.resize(3, count);
  branch.radii_mm.resize(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    branch.points_mm.col(i) = points[index(i)];
    branch.radii_mm(i) = radii[index(i)];
  }
  return branch;
}

CenterlineBranch straight(int count, double length, double radius) {
  std::vector<Vec3> points;
  for (int i = 0; i < count; ++i) points.emplace_back(0, 0, length * i / (count - 1));
  return line_of(points, std::vector<double>(index(count), radius));
}

// The minimum of a quadratic is found between the grid's places.
TEST(BestGridPosition, IsTheVertexOfAParabola) {
  for (const double vertex : {3.2, 7.0, 11.49}) {
    Eigen::VectorXd criteria(16);
    for (Eigen::Index k = 0; k < 16; ++k) {
      criteria(k) = 5 + 0.3 * std::pow(static_cast<double>(k) - vertex, 2);
    }
    EXPECT_NEAR(best_grid_position(criteria), vertex, 1e-12);
  }
  EXPECT_EQ(best_grid_position(Eigen::VectorXd::LinSpaced(9, 0, 1)), 0);
  EXPECT_EQ(best_grid_position(Eigen::VectorXd::LinSpaced(9, 1, 0)), 8);
}

TEST(BranchSamples, OfDensePointsAreThePoints) {
  const CenterlineBranch branch = straight(21, 20, 1.5);
  const BranchSamples samples = samples_of(branch, false, false);
  ASSERT_EQ(samples.points.rows(), 21);
  EXPECT_EQ((samples.points.transpose() - branch.points_mm).cwiseAbs().maxCoeff(), 0);
  EXPECT_EQ(samples.weights.minCoeff(), 1);
  EXPECT_NEAR(samples.length(), 20, 1e-12);
}

TEST(BranchSamples, BetweenFarPointsLieSomeWithoutWeightNoFartherApartThanAGap) {
  const CenterlineBranch branch = straight(6, 50, 1.0);  // ten radii between points
  const BranchSamples samples = samples_of(branch, false, false);
  EXPECT_EQ(samples.weights.sum(), 6);
  EXPECT_GT(samples.points.rows(), 30);
  for (Eigen::Index i = 1; i < samples.points.rows(); ++i) {
    const double gap = (samples.points.row(i) - samples.points.row(i - 1)).norm();
    EXPECT_LE(gap, SampleRules::kGapRadii * 1.0 + 1e-12);
    EXPECT_NEAR(samples.parameters(i) - samples.parameters(i - 1), gap, 1e-12);
  }
}

TEST(BranchSamples, OfFewPointsHaveEnoughWithWeight) {
  for (const int given : {2, 3, 4}) {
    const BranchSamples samples = samples_of(straight(given, 3, 1.0), false, false);
    EXPECT_GE(samples.weights.sum(), SampleRules::kFewestSamples) << given;
  }
}

TEST(BranchSamples, LeaveOutARadiusThatIsTheParentsAndOnlyAtAJunction) {
  std::vector<Vec3> points;
  for (int i = 0; i < 10; ++i) points.emplace_back(0, 0, i);
  std::vector<double> radii(10, 1.0);
  radii[0] = 2.5;
  const CenterlineBranch branch = line_of(points, radii);
  EXPECT_EQ(samples_of(branch, true, true).radius_weights.sum(), 9);
  EXPECT_EQ(samples_of(branch, true, true).radius_weights(0), 0);
  EXPECT_EQ(samples_of(branch, false, true).radius_weights.sum(), 10);
  EXPECT_EQ(samples_of(branch, true, true).weights.sum(), 10);
}

TEST(RadiusSpline, FollowsAnExponentialTaperAtAnyStrength) {
  // The logarithm is linear, so no bending penalty changes it.
  std::vector<Vec3> points;
  std::vector<double> radii;
  for (int i = 0; i <= 30; ++i) {
    points.emplace_back(i, 0, 0);
    radii.push_back(2 * std::exp(-0.02 * i));
  }
  const BranchSamples samples = samples_of(line_of(points, radii), false, false);
  for (const double strength : {1e-3, 1.0, 1e4}) {
    RadiusSpline spline(samples, knots_for(samples));
    spline.smooth(samples, strength);
    const BSplineCurve<1> log_radius = spline.log_radius();
    for (int k = 0; k <= 60; ++k) {
      const double t = 30.0 * k / 60;
      EXPECT_NEAR(std::exp(log_radius.at(t)(0)), 2 * std::exp(-0.02 * t), 1e-6);
    }
  }
}

TEST(RadiusSpline, KeepsItsRulesAtAStepHoweverStrongItIsAskedToSmooth) {
  std::vector<Vec3> points;
  std::vector<double> radii;
  for (int i = 0; i <= 40; ++i) {
    points.emplace_back(i, 0, 0);
    radii.push_back(i < 20 ? 1.0 : 1.6);
  }
  const BranchSamples samples = samples_of(line_of(points, radii), false, false);
  RadiusSpline spline(samples, knots_for(samples));
  spline.smooth(samples, 1e6);
  const BSplineCurve<1> log_radius = spline.log_radius();
  const double step = std::log(1.6);
  for (int i = 0; i <= 40; ++i) {
    const double off = std::abs(log_radius.at(i)(0) - std::log(radii[index(i)]));
    const double beside = i == 19 || i == 20 ? step : 0.0;
    EXPECT_LE(off, RadiusRules::kChange + 0.5 * beside + 1e-9) << i;
  }
}

struct Wave {
  BranchSamples samples;
  PenalisedSpline spline;
  RadiusSpline radii;
};

// A zigzag of one radius to either side.
Wave zigzag(double amplitude) {
  std::vector<Vec3> points;
  for (int i = 0; i <= 24; ++i) points.emplace_back(i % 2 == 0 ? amplitude : -amplitude, 0, i);
  BranchSamples samples = samples_of(line_of(points, std::vector<double>(25, 1.0)), false, false);
  const KnotVector knots = knots_for(samples);
  PenalisedSpline spline(knots, samples.parameters, samples.points, samples.weights);
  RadiusSpline radii(samples, knots);
  radii.smooth(samples, 1.0);
  return {std::move(samples), std::move(spline), std::move(radii)};
}

Eigen::MatrixXd ends_of(const BranchSamples& samples) {
  Eigen::MatrixXd ends(2, 3);
  ends << samples.points.row(0), samples.points.bottomRows(1);
  return ends;
}

TEST(FollowRules, IsThePlainSplineWhereThatKeepsThem) {
  const Wave wave = zigzag(0.01);
  const BSplineCurve<1> log_radius = wave.radii.log_radius();
  const PathLimits limits{wave.samples, wave.spline, log_radius,           0.5,
                          0.8,          0,           wave.samples.length()};
  const Eigen::MatrixXd ends = ends_of(wave.samples);
  const Followed followed = follow_rules(limits, 100.0, ends);
  EXPECT_EQ(followed.excess, 0);
  EXPECT_EQ(followed.coefficients, wave.spline.solve(100.0, ends));
}

TEST(FollowRules, NoSampleMovesFartherThanAllowedWhereThePlainSplineWould) {
  const Wave wave = zigzag(0.6);
  const BSplineCurve<1> log_radius = wave.radii.log_radius();
  // Bends may be as sharp as they like: only the moves are asked for.
  const PathLimits limits{wave.samples, wave.spline, log_radius,           0.5,
                          1e9,          0,           wave.samples.length()};
  const Eigen::MatrixXd ends = ends_of(wave.samples);
  const double strength = 1e4;
  const auto largest_move = [&](const Eigen::MatrixXd& C) {
    return (wave.spline.values_at_samples(C) - wave.samples.points).rowwise().norm().maxCoeff();
  };
  const Eigen::MatrixXd plain = wave.spline.solve(strength, ends);
  ASSERT_GT(largest_move(plain), 0.55);
  const Followed followed = follow_rules(limits, strength, ends);
  EXPECT_EQ(followed.excess, 0);
  EXPECT_LE(largest_move(followed.coefficients), 0.5 + 1e-12);

  // The ends are kept exactly, and nothing wanders off to the other side.
  const Eigen::MatrixXd at = wave.spline.values_at_samples(followed.coefficients);
  EXPECT_NEAR((at.row(0) - ends.row(0)).norm(), 0, 1e-9);
  EXPECT_NEAR((at.bottomRows(1) - ends.row(1)).norm(), 0, 1e-9);
  for (Eigen::Index i = 1; i + 1 < at.rows(); ++i) {
    if (wave.samples.weights(i) == 0) continue;  // halfway between, on the axis
    EXPECT_LT(std::abs(at(i, 0)), std::abs(wave.samples.points(i, 0)));
  }
}

TEST(FollowRules, OpensABendUntilItIsNoSharperThanAllowed) {
  // A turn by 75 degrees between two straight legs, rounded by nothing.
  std::vector<Vec3> points;
  const double turn = 75 * std::numbers::pi / 180;
  for (int i = -12; i <= 12; ++i) {
    points.push_back(i < 0 ? Vec3(i, 0, 0) : Vec3(i * std::cos(turn), 0, i * std::sin(turn)));
  }
  const BranchSamples samples =
      samples_of(line_of(points, std::vector<double>(25, 1.0)), false, false);
  const KnotVector knots = knots_for(samples);
  const PenalisedSpline spline(knots, samples.parameters, samples.points, samples.weights);
  RadiusSpline radii(samples, knots);
  radii.smooth(samples, 1.0);
  const BSplineCurve<1> log_radius = radii.log_radius();
  const PathLimits limits{samples, spline, log_radius, 0.5, 0.8, 0, samples.length()};
  const Eigen::MatrixXd ends = ends_of(samples);
  const auto sharpest = [&](const Eigen::MatrixXd& C) {
    const BSplineCurve<3> curve(knots, C.transpose());
    double largest = 0;
    for (int k = 0; k <= 2000; ++k) {
      const double t = samples.length() * k / 2000;
      largest = std::max(largest, bend_from(curve.at(t, 1), curve.at(t, 2), 1.0));
    }
    return largest;
  };
  ASSERT_GT(sharpest(spline.solve(0.01, ends)), 0.9);
  const Followed followed = follow_rules(limits, 0.01, ends);
  EXPECT_EQ(followed.excess, 0);
  EXPECT_LE(sharpest(followed.coefficients), 0.82);  // bends are sampled eight times a span
}

TEST(BendFrom, OfACircleIsItsRadiusOverTheCirclesInAnyParameter) {
  for (const double speed : {0.1, 1.0, 7.0}) {
    const Vec3 d1 = speed * 4 * Vec3::UnitX();
    const Vec3 d2 = speed * speed * 4 * Vec3::UnitY() + 3 * Vec3::UnitX();
    EXPECT_NEAR(bend_from(d1, d2, 1.2), 1.2 / 4, 1e-12);
  }
  EXPECT_TRUE(std::isinf(bend_from(Vec3::Zero(), Vec3::UnitX(), 1.0)));
}

TEST(BranchSmoother, TakesNoiseOutOfACircleAndStaysOnIt) {
  Random random(7);
  std::vector<Vec3> points;
  std::vector<double> radii;
  double noise = 0;
  for (int i = 0; i <= 80; ++i) {
    const double a = std::numbers::pi * i / 80;
    const Vec3 off(random.uniform(-0.2, 0.2), random.uniform(-0.2, 0.2), random.uniform(-0.2, 0.2));
    points.push_back(Vec3(20 * std::cos(a), 20 * std::sin(a), 0) + off);
    radii.push_back(2.0);
    noise += off.squaredNorm() / 81;
  }
  const CenterlineBranch branch = line_of(points, radii);
  BranchSmoother smoother(branch, {}, {}, 2.0, {});
  smoother.choose_strengths(best_grid_position(smoother.position_criteria()),
                            best_grid_position(smoother.radius_criteria()));
  const Vec3 first(20, 0, 0);
  const Vec3 last(-20, 0, 0);
  const SmoothPath smooth = smoother.smooth(first, last);
  EXPECT_NEAR((smooth.path.at(0).head<3>() - first).norm(), 0, 1e-9);
  EXPECT_NEAR((smooth.path.at(smooth.path.knots().last()).head<3>() - last).norm(), 0, 1e-9);
  EXPECT_NEAR(smooth.path.knots().last(), 20 * std::numbers::pi, 0.3);
  EXPECT_EQ(smooth.radius_reduced_to, 1.0);
  // Of the noise little is left in the bends; one sample off by 0.2 between its neighbours bends by
  // more than 1.
  EXPECT_GT(smooth.sharpest_bend, 2.0 / 20);
  EXPECT_LT(smooth.sharpest_bend, 0.3);
  double off = 0;
  for (int k = 0; k <= 200; ++k) {
    const Vec4 p = smooth.path.at(smooth.path.knots().last() * k / 200);
    off += (std::pow(p.head<2>().norm() - 20, 2) + p.z() * p.z()) / 201;
    EXPECT_NEAR(p(3), 2.0, 1e-3);
  }
  EXPECT_LT(off, noise / 4);
}

TEST(WithKnotsEachRadius, IsTheSamePathWithAKnotToEachRadius) {
  Eigen::Matrix4Xd points(4, 2);
  points << 0, 3, 0, 0, 0, 30, 0.8, 1.2;
  const BSplineCurve<4> path(KnotVector::bezier(1), points);
  // Over its length, as smoothed paths are.
  const BSplineCurve<4> line(KnotVector::clamped(1, {0.0, 30.15}), points);
  const BSplineCurve<4> fine = with_knots_each_radius(line);
  const std::vector<double> breaks = fine.knots().breakpoints();
  ASSERT_GT(breaks.size(), 30U);
  for (std::size_t k = 1; k < breaks.size(); ++k) EXPECT_LE(breaks[k] - breaks[k - 1], 1.0 + 1e-12);
  for (int k = 0; k <= 50; ++k) {
    const double t = 30.15 * k / 50;
    EXPECT_NEAR((fine.at(t) - line.at(t)).norm(), 0, 1e-12);
  }
  // A path of less than a radius is as it was.
  EXPECT_EQ(with_knots_each_radius(path).knots().control_point_count(), 2);
}

}  // namespace
}  // namespace angiospline
