#include <cmath>

#include <gtest/gtest.h>

#include "kernel/evaluate/grid.h"
#include "kernel/fit/fit.h"
#include "tests/shapes/random_splines.h"

namespace angiospline {
namespace {

TEST(Interpolate, ReproducesTheSplineTheDataCameFrom) {
  Random random(1);
  for (int round = 0; round < 300; ++round) {
    const KnotVector knots = random_knots(random, 1 + random.below(7));
    const BSplineCurve<3> curve = random_curve<3>(random, knots);
    const std::vector<double> nodes = knots.greville();
    if (nodes.front() < knots.first() || nodes.back() > knots.last()) continue;  // floating ends
    const auto again = interpolate<3>(knots, nodes, evaluate(curve, nodes));
    ASSERT_TRUE(again) << again.error().message();
    EXPECT_LT((again->control_points() - curve.control_points()).cwiseAbs().maxCoeff(), 1e-11);
  }
}

TEST(Interpolate, NamesTheViolatedSchoenbergWhitneyPair) {
  const KnotVector knots = KnotVector::clamped(2, {0, 1, 2, 3});
  const Eigen::Matrix<double, 1, Eigen::Dynamic> values = Eigen::RowVectorXd::Zero(5);
  const auto bad = interpolate<1>(knots, {0, 0.1, 0.2, 0.3, 3}, values);
  ASSERT_FALSE(bad);
  EXPECT_NE(bad.error().message().find("parameter 3"), std::string::npos) << bad.error().message();
  EXPECT_NE(bad.error().message().find("basis function 3"), std::string::npos);
  EXPECT_TRUE(interpolate<1>(knots, {0, 0.1, 0.2, 1.3, 3}, values));
}

TEST(Interpolate, RefusesCountsThatDifferAndParametersThatDoNotIncrease) {
  const KnotVector knots = KnotVector::clamped(2, {0, 1});
  const Eigen::Matrix<double, 1, Eigen::Dynamic> values = Eigen::RowVectorXd::Zero(3);
  EXPECT_FALSE(interpolate<1>(knots, {0, 1}, values));
  EXPECT_FALSE(interpolate<1>(knots, {0, 0.5, 0.5}, values));
  EXPECT_FALSE(interpolate<1>(knots, {0, 0.5, 1.5}, values));
  EXPECT_FALSE(interpolate<1>(knots, {0, std::nan(""), 1}, values));
}

TEST(InterpolateAtGreville, ReproducesASurface) {
  Random random(2);
  const KnotVector u = KnotVector::clamped(5, {0, 0.4, 0.5, 1}, 2);
  const KnotVector v = KnotVector::clamped(3, {0, 1, 2, 5});
  const BSplineSurface<3> surface = random_surface<3>(random, u, v);
  const auto grid = evaluate_grid(surface, u.greville(), v.greville());
  const auto again = interpolate_at_greville<3>(u, v, grid.points());
  EXPECT_LT((again.control_points() - surface.control_points()).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(FitCurve, FindsTheSplineThatNoiselessPointsLieOn) {
  Random random(3);
  for (int round = 0; round < 200; ++round) {
    const KnotVector knots = random_knots(random, 1 + random.below(5), 0, false);
    const BSplineCurve<2> curve = random_curve<2>(random, knots);
    std::vector<double> parameters;
    const std::vector<double> breaks = knots.breakpoints();
    for (std::size_t k = 0; k + 1 < breaks.size(); ++k) {
      for (int i = 0; i < 9; ++i) {
        parameters.push_back(breaks[k] + (breaks[k + 1] - breaks[k]) * (i + 0.5) / 9);
      }
    }
    const auto fit = fit_curve<2>(knots, parameters, evaluate(curve, parameters));
    ASSERT_TRUE(fit) << fit.error().message();
    EXPECT_LT((fit->curve.control_points() - curve.control_points()).cwiseAbs().maxCoeff(), 1e-9);
    EXPECT_LT(fit->largest_residual, 1e-12);
  }
}

TEST(FitCurve, IsTheLeastSquaresSolutionOfADenseSolver) {
  Random random(4);
  const KnotVector knots = KnotVector::clamped(5, {0, 0.2, 0.5, 0.6, 1});
  std::vector<double> parameters;
  Eigen::Matrix3Xd points(3, 60);
  for (int i = 0; i < 60; ++i) {
    parameters.push_back(random.uniform());
    points.col(i) << random.gaussian(), random.gaussian(), random.gaussian();
  }
  const auto fit = fit_curve<3>(knots, parameters, points);
  ASSERT_TRUE(fit);
  const Eigen::MatrixXd A = collocation_matrix(knots, parameters).to_dense();
  const Eigen::MatrixXd residual = A * fit->curve.control_points().transpose() - points.transpose();
  EXPECT_LT((A.transpose() * residual).cwiseAbs().maxCoeff(), 1e-13);  // the normal equations
}

TEST(FitCurve, MeetsHeldEndsExactly) {
  const KnotVector knots = KnotVector::clamped(5, {0, 0.3, 0.7, 2});
  const std::vector<double> parameters = spaced(0, 2, 80);
  Eigen::Matrix2Xd points(2, 80);
  for (int i = 0; i < 80; ++i) {
    const double t = parameters[static_cast<std::size_t>(i)];
    points.col(i) << std::cos(t), std::sin(3 * t);
  }
  CurveFitOptions<2> options;
  options.first = {Eigen::Vector2d(1.1, 0.05), Eigen::Vector2d(0.2, 3.1)};
  options.last = {Eigen::Vector2d(-0.4, -0.3), Eigen::Vector2d(-0.9, 2.8)};
  const auto fit = fit_curve<2>(knots, parameters, points, options);
  ASSERT_TRUE(fit);
  EXPECT_EQ(fit->curve.at(0), *options.first.position);
  EXPECT_EQ(fit->curve.at(2), *options.last.position);
  EXPECT_LT((fit->curve.at(0, 1) - *options.first.derivative).norm(), 1e-13);
  EXPECT_LT((fit->curve.at(2, 1) - *options.last.derivative).norm(), 1e-13);
  EXPECT_LT(fit->rms_residual, 0.1);
}

TEST(FitCurve, NamesTheBasisFunctionThatNoPointDetermines) {
  const KnotVector knots = KnotVector::clamped(3, {0, 1, 2, 3, 4});
  std::vector<double> parameters;
  for (int i = 0; i < 30; ++i) parameters.push_back(i / 30.0);
  const Eigen::Matrix<double, 1, Eigen::Dynamic> values = Eigen::RowVectorXd::Ones(30);
  const auto fit = fit_curve<1>(knots, parameters, values);
  ASSERT_FALSE(fit);
  EXPECT_NE(fit.error().message().find("basis function 4"), std::string::npos)
      << fit.error().message();
  CurveFitOptions<1> rough;
  rough.roughness = 1e-3;
  rough.roughness_derivative = 2;
  const auto smooth = fit_curve<1>(knots, parameters, values, rough);
  ASSERT_TRUE(smooth) << smooth.error().message();
  EXPECT_NEAR(smooth->curve.at(4)(0), 1, 1e-8);
}

TEST(FitSurface, ReproducesASurfaceAndNamesTheDirectionThatFails) {
  Random random(5);
  const KnotVector u = KnotVector::clamped(3, {0, 1, 3});
  const KnotVector v = KnotVector::clamped(5, {0, 2, 3, 4});
  const BSplineSurface<3> surface = random_surface<3>(random, u, v);
  const auto us = spaced(0, 3, 21);
  const auto vs = spaced(0, 4, 40);
  const auto points = evaluate_grid(surface, us, vs).points();
  const auto again = fit_surface<3>(u, v, us, vs, points);
  ASSERT_TRUE(again) << again.error().message();
  EXPECT_LT((again->control_points() - surface.control_points()).cwiseAbs().maxCoeff(), 1e-11);
  const auto bad = fit_surface<3>(u, v, us, spaced(0, 1, 40), points);
  ASSERT_FALSE(bad);
  EXPECT_NE(bad.error().message().find("v direction"), std::string::npos);
}

TEST(GramMatrix, IntegratesProductsOfDerivatives) {
  const KnotVector knots = KnotVector::clamped(3, {0, 1, 3});
  const Eigen::MatrixXd gram = gram_matrix(knots, 1).to_dense();
  EXPECT_LT((gram - gram.transpose()).cwiseAbs().maxCoeff(), 1e-14);
  // The spline t has derivative 1: its energy is the length of the domain.
  Eigen::VectorXd nodes(knots.control_point_count());
  for (int i = 0; i < nodes.size(); ++i) nodes(i) = knots.greville(i);
  EXPECT_NEAR(nodes.dot(gram * nodes), 3, 1e-13);
  EXPECT_EQ(gram_matrix(knots, 4).to_dense().cwiseAbs().maxCoeff(), 0);
}

}  // namespace
}  // namespace angiospline
