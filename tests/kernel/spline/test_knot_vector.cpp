#include <gtest/gtest.h>

#include "kernel/spline/curve.h"
#include "kernel/spline/knot_vector.h"

namespace angiospline {
namespace {

TEST(KnotVector, RefusesDecreasingKnotsAndNamesThem) {
  const auto bad = KnotVector::make(1, {0, 0, 2, 1, 3, 3});
  ASSERT_FALSE(bad);
  EXPECT_EQ(bad.error().where, "knot 3");
}

TEST(BasisAt, IsAPartitionOfUnityWithDerivativesThatSumToZero) {
  const KnotVector knots = KnotVector::clamped(5, {0, 0.3, 0.5, 1}, 2);
  for (const double t : {0.0, 0.1, 0.3, 0.49, 0.5, 0.99, 1.0}) {
    const BasisValues basis = basis_at(knots, t, 3);
    EXPECT_NEAR(basis.values.row(0).sum(), 1, 1e-14);
    for (int d = 1; d <= 3; ++d) EXPECT_NEAR(basis.values.row(d).sum(), 0, 1e-9);
  }
}

TEST(BSplineCurve, DerivativesAgreeWithFiniteDifferences) {
  const KnotVector knots = KnotVector::clamped(5, {0, 0.4, 1});
  Eigen::Matrix3Xd points(3, knots.control_point_count());
  for (int i = 0; i < points.cols(); ++i) points.col(i) << i, i * i * 0.1, std::sin(i);
  const BSplineCurve<3> curve(knots, points);
  const double h = 1e-5;
  for (const double t : {0.1, 0.35, 0.6, 0.9}) {
    const Eigen::Vector3d difference = (curve.at(t + h) - curve.at(t - h)) / (2 * h);
    EXPECT_LT((curve.at(t, 1) - difference).norm(), 1e-7);
  }
}

}  // namespace
}  // namespace angiospline
