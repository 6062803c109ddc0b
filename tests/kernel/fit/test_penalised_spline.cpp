// The penalised spline against dense algebra, and the strength it chooses on known noise.
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <gtest/gtest.h>

#include "kernel/fit/fit.h"
#include "kernel/fit/penalised_spline.h"
#include "tests/shapes/random_splines.h"

namespace angiospline {
namespace {

struct Data {
  KnotVector knots;
  Eigen::VectorXd parameters;
  Eigen::MatrixXd values;
  Eigen::VectorXd weights;
};

Data random_data(Random& random, int samples) {
  Data data{KnotVector::clamped(5, {0, 0.2, 0.35, 0.6, 0.8, 1}), Eigen::VectorXd(samples),
            Eigen::MatrixXd(samples, 2), Eigen::VectorXd(samples)};
  for (int i = 0; i < samples; ++i) {
    data.parameters(i) = i == 0 ? 0 : i + 1 == samples ? 1 : random.uniform();
    data.values.row(i) << random.gaussian(), random.gaussian();
    data.weights(i) = random.uniform(0.2, 2);
  }
  return data;
}

// B' W B + strength * P, with P the Gram matrix of derivatives.
struct Dense {
  Eigen::MatrixXd B, A, P;

  Dense(const Data& data, double strength, int order)
      : B(collocation_matrix(data.knots, {data.parameters.begin(), data.parameters.end()})
              .to_dense()),
        P(gram_matrix(data.knots, order).to_dense()) {
    A = B.transpose() * data.weights.asDiagonal() * B + strength * P;
  }
};

TEST(PenalisedSpline, SolvesTheNormalEquationsOfEitherPenalty) {
  Random random(1);
  for (const int order : {2, 3}) {
    for (const double strength : {1e-8, 1e-3, 10.0}) {
      const Data data = random_data(random, 70);
      const PenalisedSpline spline(data.knots, data.parameters, data.values, data.weights, order);
      const Dense dense(data, strength, order);
      const Eigen::MatrixXd right = dense.B.transpose() * data.weights.asDiagonal() * data.values;
      const Eigen::MatrixXd C = spline.solve(strength);
      EXPECT_LT((dense.A * C - right).norm(), 1e-9 * (right.norm() + dense.A.norm() * C.norm()));
      EXPECT_LT((spline.values_at_samples(C) - dense.B * C).norm(), 1e-12 * (1 + C.norm()));
    }
  }
}

TEST(PenalisedSpline, GivenEndsAreMetAndTheRestIsBestBetweenThem) {
  Random random(2);
  const Data data = random_data(random, 50);
  const PenalisedSpline spline(data.knots, data.parameters, data.values, data.weights);
  Eigen::MatrixXd ends(2, 2);
  ends << 1, 2, 3, 4;
  const Eigen::MatrixXd C = spline.solve(1e-3, ends);
  EXPECT_EQ(C.row(0), ends.row(0));
  EXPECT_EQ(C.bottomRows(1), ends.row(1));
  const Dense dense(data, 1e-3, 2);
  const Eigen::MatrixXd g =
      dense.A * C - dense.B.transpose() * data.weights.asDiagonal() * data.values;
  EXPECT_LT(g.middleRows(1, g.rows() - 2).norm(), 1e-9 * g.norm());
}

TEST(PenalisedSpline, CondensedEndsHaveTheWholeSolutionsEndsAsTheirMinimum) {
  Random random(3);
  const Data data = random_data(random, 50);
  const PenalisedSpline spline(data.knots, data.parameters, data.values, data.weights);
  const CondensedEnds ends = spline.condensed_ends(1e-2);
  const Eigen::MatrixXd best = ends.matrix.ldlt().solve(ends.right);
  const Eigen::MatrixXd C = spline.solve(1e-2);
  EXPECT_LT((best.row(0) - C.row(0)).norm(), 1e-8);
  EXPECT_LT((best.row(1) - C.bottomRows(1)).norm(), 1e-8);
  EXPECT_NEAR(ends.matrix(0, 1), ends.matrix(1, 0), 1e-9 * ends.matrix.norm());
}

TEST(PenalisedSpline, AStifferSpanBendsLess) {
  Random random(4);
  const Data data = random_data(random, 80);
  PenalisedSpline spline(data.knots, data.parameters, data.values, data.weights);
  const auto bending_in_first_span = [&] {
    const Eigen::MatrixXd C = spline.solve(1e-5);
    double sum = 0;
    for (int k = 0; k < 20; ++k)
      sum += BSplineCurve<2>(data.knots, C.transpose()).at(0.2 * (k + 0.5) / 20, 2).squaredNorm();
    return sum;
  };
  const double soft = bending_in_first_span();
  Eigen::VectorXd stiffness = Eigen::VectorXd::Ones(spline.span_count());
  stiffness(0) = 1e4;
  spline.set_stiffness(stiffness);
  EXPECT_LT(bending_in_first_span(), 0.1 * soft);
}

TEST(PenalisedSpline, ItsCriterionIsLeastNearTheStrengthThatIsBestForTheTruth) {
  Random random(5);
  const int samples = 300;
  std::vector<double> breaks;
  for (int k = 0; k <= 60; ++k) breaks.push_back(k / 60.0);
  const KnotVector knots = KnotVector::clamped(5, breaks);
  Eigen::VectorXd t(samples);
  Eigen::MatrixXd truth(samples, 1), noisy(samples, 1);
  for (int i = 0; i < samples; ++i) {
    t(i) = (i + 0.5) / samples;
    truth(i) = std::sin(2 * std::numbers::pi * t(i));
    noisy(i) = truth(i) + 0.1 * random.gaussian();
  }
  const PenalisedSpline spline(knots, t, noisy, Eigen::VectorXd::Ones(samples));
  double chosen = 0, least = std::numeric_limits<double>::infinity();
  double best_error = std::numeric_limits<double>::infinity(), chosen_error = 0;
  for (double strength = 1e-12; strength < 1e3; strength *= 3) {
    const double error =
        (spline.values_at_samples(spline.solve(strength)) - truth).norm() / std::sqrt(samples);
    best_error = std::min(best_error, error);
    if (const double c = spline.criterion(strength, 0); c < least) {
      least = c;
      chosen = strength;
      chosen_error = error;
    }
  }
  EXPECT_GT(chosen, 1e-10);
  EXPECT_LT(chosen, 1e2);
  EXPECT_LT(chosen_error, 1.5 * best_error);
  EXPECT_LT(chosen_error, 0.04);  // of noise of 0.1
}

}  // namespace
}  // namespace angiospline
