// The banded fit against the dense normal equations it stands for.
#include <Eigen/QR>
#include <gtest/gtest.h>

#include "kernel/fit/fit.h"
#include "kernel/fit/penalised_curve.h"
#include "tests/shapes/random_splines.h"

namespace angiospline {
namespace {

SplineFitProblem random_problem(Random& random, const KnotVector& knots, int samples) {
  SplineFitProblem problem;
  for (int i = 0; i < samples; ++i) {
    problem.parameters.push_back(knots.first() +
                                 (knots.last() - knots.first()) * (i + 0.5) / samples);
    problem.weights.push_back(random.uniform(0.1, 2));
  }
  problem.values = Eigen::MatrixXd(samples, 3);
  for (double& v : problem.values.reshaped()) v = random.gaussian();
  return problem;
}

// Half the gradient of sum w |c(t) - v|^2 + integral bending |c''|^2 in each control point.
Eigen::MatrixXd gradient(const KnotVector& knots, const SplineFitProblem& problem, double bending,
                         const Eigen::MatrixXd& control) {
  const Eigen::MatrixXd A = collocation_matrix(knots, problem.parameters).to_dense();
  const Eigen::VectorXd w =
      Eigen::Map<const Eigen::VectorXd>(problem.weights.data(), std::ssize(problem.weights));
  return A.transpose() * w.asDiagonal() * (A * control - problem.values) +
         bending * gram_matrix(knots, 2).to_dense() * control;
}

TEST(FitSpline, AtItsSolutionTheGradientVanishes) {
  Random random(1);
  for (int round = 0; round < 20; ++round) {
    const KnotVector knots = KnotVector::clamped(3, {0, 0.2, 0.5, 0.6, 1}, 1 + random.below(2));
    SplineFitProblem problem = random_problem(random, knots, 60);
    const double bending = round % 2 == 0 ? 0.0 : 1e-3;
    if (bending > 0) problem.bending.assign(knots.breakpoints().size() - 1, bending);
    const Eigen::MatrixXd control = fit_spline(knots, problem);
    const Eigen::MatrixXd g = gradient(knots, problem, bending, control);
    const double scale = gradient(knots, problem, bending, 0 * control).norm();
    EXPECT_LT(g.norm(), 1e-6 * scale);  // the ridge and the Gauss points' 15 digits
  }
}

TEST(FitSpline, HeldControlPointsStayAndTheRestIsBestBetweenThem) {
  Random random(2);
  const KnotVector knots = KnotVector::clamped(3, {0, 0.3, 0.5, 0.8, 1});
  SplineFitProblem problem = random_problem(random, knots, 50);
  problem.first = Eigen::MatrixXd::Constant(2, 3, 1.5);
  problem.last = Eigen::MatrixXd::Constant(1, 3, -0.5);
  const Eigen::MatrixXd control = fit_spline(knots, problem);
  EXPECT_EQ(control.topRows(2), problem.first);
  EXPECT_EQ(control.bottomRows(1), problem.last);
  const Eigen::MatrixXd g = gradient(knots, problem, 0, control);
  EXPECT_LT(g.middleRows(2, g.rows() - 3).norm(), 1e-9 * g.norm());
}

TEST(FitSpline, WithEverythingHeldTheSamplesSayNothing) {
  Random random(3);
  const KnotVector knots = KnotVector::bezier(3, 0, 1);
  SplineFitProblem problem = random_problem(random, knots, 9);
  problem.first = Eigen::MatrixXd::Random(2, 3);
  problem.last = Eigen::MatrixXd::Random(2, 3);
  Eigen::MatrixXd all(4, 3);
  all << problem.first, problem.last;
  EXPECT_EQ(fit_spline(knots, problem), all);
}

TEST(FitSpline, ReproducesASplineOfItsOwnSpace) {
  Random random(4);
  const KnotVector knots = KnotVector::clamped(4, {-1, 0.2, 0.5, 2});
  const BSplineCurve<3> curve = random_curve<3>(random, knots);
  SplineFitProblem problem = random_problem(random, knots, 90);
  for (std::size_t i = 0; i < problem.parameters.size(); ++i)
    problem.values.row(static_cast<Eigen::Index>(i)) = curve.at(problem.parameters[i]).transpose();
  const Eigen::MatrixXd fitted = fit_spline(knots, problem);
  const Eigen::MatrixXd A = collocation_matrix(knots, problem.parameters).to_dense();
  EXPECT_LT((A * fitted - problem.values).norm(), 1e-6);
}

TEST(FitSpline, ASpanWithoutSamplesStaysNearZero) {
  const KnotVector knots = KnotVector::clamped(1, {0, 1, 2, 3});
  SplineFitProblem problem;
  problem.parameters = {0, 0.5, 1};
  problem.values = Eigen::MatrixXd::Ones(3, 1);
  const Eigen::MatrixXd control = fit_spline(knots, problem);
  EXPECT_NEAR(control(0), 1, 1e-9);
  EXPECT_NEAR(control(1), 1, 1e-9);
  EXPECT_EQ(control(2), 0);
  EXPECT_EQ(control(3), 0);
}

}  // namespace
}  // namespace angiospline
