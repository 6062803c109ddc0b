// The bound is above what samples of the difference show, and not far above.
#include <cmath>

#include <gtest/gtest.h>

#include "kernel/refine/difference_bound.h"
#include "kernel/refine/refinement.h"
#include "tests/shapes/random_splines.h"

namespace angiospline {
namespace {

double bound_of(const BSplineCurve<3>& a, const BSplineCurve<3>& b, double enough) {
  return difference_bound(a.knots(), a.control_points().data(), b.knots(),
                          b.control_points().data(), 3, 3, enough);
}

double sampled_difference(const BSplineCurve<3>& a, const BSplineCurve<3>& b) {
  double largest = 0;
  for (int i = 0; i <= 2000; ++i) {
    const double t = a.knots().first() + (a.knots().last() - a.knots().first()) * i / 2000;
    largest = std::max(largest, (a.at(t) - b.at(t)).norm());
  }
  return largest;
}

TEST(DifferenceBound, IsAboveEverySampleAndTightensWhereMoreIsAsked) {
  Random random(1);
  int tightened = 0;
  for (int round = 0; round < 40; ++round) {
    const int p = 2 + random.below(4);
    const BSplineCurve<3> a = random_curve<3>(random, KnotVector::clamped(p, {0, 0.2, 0.7, 1}));
    const BSplineCurve<3> b =
        random_curve<3>(random, KnotVector::clamped(p, {0, 0.4, 0.5, 1}, random.below(2) + 1));
    const double seen = sampled_difference(a, b);
    const double rough = bound_of(a, b, 1e9), fine = bound_of(a, b, 0);
    EXPECT_GE(rough, seen * (1 - 1e-12));
    EXPECT_GE(fine, seen * (1 - 1e-12));
    EXPECT_LE(fine, rough * (1 + 1e-12));
    EXPECT_LT(fine, 2 * seen);
    tightened += fine < 0.99 * rough;
  }
  EXPECT_GT(tightened, 10);
}

TEST(DifferenceBound, OfACurveAndItsRefinementIsRounding) {
  Random random(2);
  for (int round = 0; round < 40; ++round) {
    const BSplineCurve<3> curve =
        random_curve<3>(random, random_knots(random, 1 + random.below(5)));
    const auto fine = insert_knots(curve, random_new_knots(random, curve.knots(), 4));
    ASSERT_TRUE(fine);
    EXPECT_LT(bound_of(curve, *fine, 0), 1e-12);
  }
}

TEST(DifferenceBound, EndsThatFloatDifferentlyAreComparedOverTheDomain) {
  const auto uniform = KnotVector::make(2, {-2, -1, 0, 1, 2, 3, 4});
  ASSERT_TRUE(uniform);
  const BSplineCurve<1> one(*uniform, Eigen::RowVectorXd::Constant(4, 1.0));
  const BSplineCurve<1> three(KnotVector::clamped(2, {0, 1, 2}),
                              Eigen::RowVectorXd::Constant(4, 3.0));
  ASSERT_FALSE(same_ends(one.knots(), three.knots()));
  EXPECT_NEAR(difference_bound(one.knots(), one.control_points().data(), three.knots(),
                               three.control_points().data(), 1, 1, 0),
              2, 1e-14);
}

TEST(DifferenceBound, GroupsOfABlockAreMeasuredEachForItself) {
  const double block[] = {3, 4, 0, 1, 2, 2};
  EXPECT_EQ(largest_squared(block, 6, 3), 25);
  EXPECT_EQ(largest_squared(block, 6, 6), 34);
  EXPECT_EQ(largest_squared(block, 6, 1), 16);
}

}  // namespace
}  // namespace angiospline
