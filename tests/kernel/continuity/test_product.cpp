#include <cmath>

#include <gtest/gtest.h>

#include "kernel/continuity/product.h"
#include "kernel/refine/reshape.h"
#include "kernel/spline/knot_algebra.h"
#include "tests/shapes/random_splines.h"

namespace angiospline {
namespace {

TEST(Product, IsTheProductAtEveryParameterForAnyKnots) {
  Random random(1);
  for (int round = 0; round < 300; ++round) {
    const KnotVector ka = random_knots(random, random.below(6));
    const KnotVector kb = with_domain(random_knots(random, random.below(6)), ka.first(), ka.last());
    const BSplineCurve<3> a = random_curve<3>(random, ka);
    const BSplineCurve<3> b = random_curve<3>(random, kb);
    const BSplineCurve<1> scalar = random_curve<1>(random, kb);
    const BSplineCurve<1> dot = dot_product(a, b);
    const BSplineCurve<3> cross = cross_product(a, b);
    const BSplineCurve<3> scaled = product(scalar, a);
    EXPECT_EQ(dot.knots().degree(), ka.degree() + kb.degree());
    for (int k = 0; k < 10; ++k) {
      const double t = random.uniform(ka.first(), ka.last());
      EXPECT_NEAR(dot.at(t)(0), a.at(t).dot(b.at(t)), 1e-13);
      EXPECT_LT((cross.at(t) - a.at(t).cross(b.at(t))).norm(), 1e-13);
      EXPECT_LT((scaled.at(t) - scalar.at(t)(0) * a.at(t)).norm(), 1e-13);
    }
  }
}

TEST(Product, WithTheConstantOneIsDegreeElevation) {
  Random random(2);
  const KnotVector knots = KnotVector::clamped(4, {0, 0.2, 0.5, 1}, 2);
  const BSplineCurve<3> curve = random_curve<3>(random, knots);
  const BSplineCurve<1> one(KnotVector::bezier(3), Eigen::RowVectorXd::Ones(4));
  const BSplineCurve<3> raised = product(one, curve);
  EXPECT_EQ(raised.knots(), elevated_knots(knots, 3));
  EXPECT_LT((raised.control_points() - elevate(curve, 3).control_points()).cwiseAbs().maxCoeff(),
            1e-14);
}

TEST(ProductKnots, KeepNoMoreContinuityThanTheFactors) {
  const KnotVector a = KnotVector::clamped(3, {0, 0.5, 1});      // C2 at 0.5
  const KnotVector b = KnotVector::clamped(2, {0, 0.25, 1}, 2);  // C0 at 0.25
  const std::vector<Knot> wanted{{0, 6}, {0.25, 5}, {0.5, 3}, {1, 6}};
  EXPECT_EQ(distinct_knots(product_knots(a, b)), wanted);
}

}  // namespace
}  // namespace angiospline
