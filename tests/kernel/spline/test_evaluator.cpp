#include <cmath>

#include <gtest/gtest.h>

#include "kernel/spline/evaluator.h"
#include "tests/shapes/random_splines.h"

namespace angiospline {
namespace {

template <int D>
void expect_agreement(Random& random) {
  const KnotVector u = random_knots(random, 1 + random.below(7), 0);
  const KnotVector v = random_knots(random, 1 + random.below(7), 0);
  const BSplineSurface<D> surface = random_surface<D>(random, u, v);
  const SurfaceEvaluator<D> evaluator(surface);
  for (int k = 0; k < 30; ++k) {
    const double s = random_parameter(random, u);
    const double t = random_parameter(random, v);
    const SurfacePartials<D> p = evaluator.partials(s, t);
    EXPECT_LT((p.point - surface.at(s, t)).norm(), 2e-13);
    EXPECT_LT((evaluator.point(s, t) - p.point).norm(), 2e-15);
    EXPECT_LT((p.u - surface.at(s, t, 1, 0)).norm(), 1e-11 * (1 + p.u.norm()));
    EXPECT_LT((p.v - surface.at(s, t, 0, 1)).norm(), 1e-11 * (1 + p.v.norm()));
  }
}

TEST(SurfaceEvaluator, AgreesWithTheRecurrenceForAllDegreesAndKnots) {
  Random random(1);
  for (int round = 0; round < 150; ++round) {
    expect_agreement<2>(random);
    expect_agreement<3>(random);
    expect_agreement<4>(random);
  }
}

TEST(SurfaceEvaluator, GivesTheSameBitsOnAnyNumberOfThreads) {
  Random random(2);
  const KnotVector knots = KnotVector::clamped(5, {0, 0.1, 0.5, 0.6, 1});
  const SurfaceEvaluator<3> evaluator(random_surface<3>(random, knots, knots));
  Eigen::Matrix2Xd parameters(2, 10001);  // several runs for each thread
  for (Eigen::Index i = 0; i < parameters.size(); ++i) parameters.data()[i] = random.uniform();
  std::vector<SurfacePartials<3>> one(10001), three(10001);
  evaluator.evaluate_all(parameters, one.data(), 1);
  evaluator.evaluate_all(parameters, three.data(), 3);
  for (std::size_t k = 0; k < one.size(); ++k) {
    ASSERT_EQ(one[k].point, three[k].point);
    ASSERT_EQ(one[k].u, three[k].u);
    ASSERT_EQ(one[k].v, three[k].v);
  }
}

TEST(PreparedBasis, FindsTheSpanOfEveryParameterAsTheKnotVectorDoes) {
  Random random(3);
  for (int round = 0; round < 200; ++round) {
    const KnotVector knots = random_knots(random, 1 + random.below(6));
    const PreparedBasis prepared(knots);
    for (int k = 0; k < 50; ++k) {
      double t = random_parameter(random, knots);
      if (k % 5 == 0) t = std::nextafter(t, knots.last());
      if (k % 7 == 0) t = std::nextafter(t, knots.first() - 1);
      EXPECT_EQ(prepared.first_function(prepared.find(t)), knots.span(t) - knots.degree());
    }
  }
}

}  // namespace
}  // namespace angiospline
