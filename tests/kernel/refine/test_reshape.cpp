#include <cmath>

#include <gtest/gtest.h>

#include "kernel/refine/refinement.h"
#include "kernel/refine/reshape.h"
#include "kernel/spline/knot_algebra.h"
#include "tests/shapes/random_splines.h"

namespace angiospline {
namespace {

TEST(Derivative, IsTheDerivativeAtEveryParameter) {
  Random random(1);
  for (int round = 0; round < 300; ++round) {
    const KnotVector knots = random_knots(random, 1 + random.below(7));
    const BSplineCurve<3> curve = random_curve<3>(random, knots);
    const BSplineCurve<3> d = derivative(curve);
    EXPECT_EQ(d.knots().degree(), knots.degree() - 1);
    for (int k = 0; k < 10; ++k) {
      const double t = random.uniform(knots.first(), knots.last());
      EXPECT_LT((d.at(t) - curve.at(t, 1)).norm(), 1e-11 * (1 + curve.at(t, 1).norm()));
    }
  }
}

TEST(Derivative, LeavesOutTheJumpOfACurveThatBreaks) {
  const KnotVector knots = *KnotVector::make(1, {0, 0, 1, 1, 2, 2});
  Eigen::Matrix<double, 1, Eigen::Dynamic> values(1, 4);
  values << 0, 1, 5, 7;
  const BSplineCurve<1> d = derivative(BSplineCurve<1>(knots, values));
  EXPECT_EQ(d.at(0.5)(0), 1);
  EXPECT_EQ(d.at(1.5)(0), 2);
}

TEST(Derivative, OfASurfaceInBothDirections) {
  Random random(2);
  for (int round = 0; round < 50; ++round) {
    const KnotVector u = random_knots(random, 2 + random.below(4));
    const KnotVector v = random_knots(random, 2 + random.below(4));
    const BSplineSurface<3> s = random_surface<3>(random, u, v);
    const BSplineSurface<3> suv = derivative_v(derivative_u(s));
    const double a = random.uniform(u.first(), u.last());
    const double b = random.uniform(v.first(), v.last());
    EXPECT_LT((suv.at(a, b) - s.at(a, b, 1, 1)).norm(), 1e-10 * (1 + s.at(a, b, 1, 1).norm()));
  }
}

TEST(Elevate, ChangesNoPointAndKeepsContinuity) {
  Random random(3);
  for (int round = 0; round < 300; ++round) {
    const KnotVector knots = random_knots(random, random.below(6));
    const int by = 1 + random.below(3);
    const BSplineCurve<3> curve = random_curve<3>(random, knots);
    const BSplineCurve<3> raised = elevate(curve, by);
    EXPECT_EQ(raised.knots().degree(), knots.degree() + by);
    for (const double t : knots.breakpoints()) {
      if (t > knots.first() && t < knots.last()) {
        EXPECT_EQ(raised.knots().multiplicity(t), knots.multiplicity(t) + by);
      }
    }
    for (int k = 0; k < 10; ++k) {
      const double t = random.uniform(knots.first(), knots.last());
      EXPECT_LT((raised.at(t) - curve.at(t)).norm(), 2e-14) << "degree " << knots.degree();
    }
  }
}

TEST(Elevate, SurfaceInBothDirections) {
  Random random(4);
  const BSplineSurface<3> s =
      random_surface<3>(random, KnotVector::clamped(2, {0, 1, 3}), KnotVector::clamped(3, {0, 2}));
  const BSplineSurface<3> raised = elevate(s, 3, 2);
  EXPECT_EQ(raised.u().degree(), 5);
  EXPECT_EQ(raised.v().degree(), 5);
  EXPECT_LT((raised.at(1.7, 0.4) - s.at(1.7, 0.4)).norm(), 1e-14);
}

TEST(Reverse, RunsBackwardsOverTheSameDomain) {
  Random random(5);
  for (int round = 0; round < 50; ++round) {
    const KnotVector u = random_knots(random, 1 + random.below(5));
    const KnotVector v = random_knots(random, 1 + random.below(5));
    const BSplineSurface<3> s = random_surface<3>(random, u, v);
    const double a = random.uniform(u.first(), u.last());
    const double b = random.uniform(v.first(), v.last());
    const double back_a = u.first() + (u.last() - a);
    const double back_b = v.first() + (v.last() - b);
    EXPECT_LT((reverse_u(s).at(back_a, b) - s.at(a, b)).norm(), 1e-10);
    EXPECT_LT((reverse_v(s).at(a, back_b) - s.at(a, b)).norm(), 1e-10);
    EXPECT_LT((swap_uv(s).at(b, a) - s.at(a, b)).norm(), 1e-14);
    EXPECT_LT((normal_vector(s, a, b) + normal_vector(swap_uv(s), b, a)).norm(),
              1e-12 * (1 + normal_vector(s, a, b).norm()));
  }
}

TEST(Join, RunsThroughBothAndRefusesAGap) {
  Random random(6);
  const BSplineCurve<2> a = random_curve<2>(random, KnotVector::clamped(3, {0, 1, 2}));
  Eigen::Matrix2Xd points =
      random_curve<2>(random, KnotVector::clamped(5, {3, 4})).control_points();
  points.col(0) = a.at(2);
  const BSplineCurve<2> b(KnotVector::clamped(5, {3, 4}), points);
  const auto joined = join(a, b, 0.0);
  ASSERT_TRUE(joined) << joined.error().message();
  EXPECT_EQ(joined->knots().degree(), 5);
  EXPECT_EQ(joined->knots().multiplicity(2), 5);
  EXPECT_LT((joined->at(1.3) - a.at(1.3)).norm(), 1e-14);
  EXPECT_LT((joined->at(2.6) - b.at(3.6)).norm(), 1e-14);
  points.col(0).x() += 0.1;
  const auto apart = join(a, BSplineCurve<2>(b.knots(), points), 0.05);
  ASSERT_FALSE(apart);
  EXPECT_NE(apart.error().message().find("0.1"), std::string::npos);
}

TEST(MakeCompatible, GivesOneSpaceAndChangesNoPoint) {
  Random random(7);
  for (int round = 0; round < 50; ++round) {
    std::vector<BSplineCurve<3>> curves;
    for (int k = 0; k < 4; ++k) {
      curves.push_back(random_curve<3>(random, random_knots(random, 1 + random.below(5))));
    }
    const auto compatible = make_compatible(curves);
    const KnotVector& common = compatible.front().knots();
    for (std::size_t k = 0; k < 4; ++k) {
      EXPECT_EQ(compatible[k].knots(), common);
      const KnotVector& own = curves[k].knots();
      const double s = random.uniform(0.01, 0.99);
      EXPECT_LT((compatible[k].at(common.first() + s * (common.last() - common.first())) -
                 curves[k].at(own.first() + s * (own.last() - own.first())))
                    .norm(),
                1e-9);
    }
  }
}

TEST(KnotAlgebra, DistinctKnotsAndBack) {
  const KnotVector knots = KnotVector::clamped(3, {0, 1, 2}, 2);
  const std::vector<Knot> wanted{{0, 4}, {1, 2}, {2, 4}};
  EXPECT_EQ(distinct_knots(knots), wanted);
  EXPECT_EQ(*from_distinct(3, wanted), knots);
}

TEST(KnotAlgebra, WithDomainMeetsTheEndsExactly) {
  const KnotVector knots = with_domain(KnotVector::clamped(3, {0.1, 0.3, 0.7}), 0.2, 1.1);
  EXPECT_EQ(knots.first(), 0.2);
  EXPECT_EQ(knots.last(), 1.1);
  EXPECT_EQ(knots.multiplicity(1.1), 4);
}

TEST(KnotAlgebra, SnappedMakesAlmostEqualKnotsEqual) {
  const KnotVector model = KnotVector::clamped(2, {0, 0.3, 1});
  const KnotVector near = KnotVector::clamped(2, {0, 0.1 + 0.2, 1});
  EXPECT_FALSE(near == model);
  EXPECT_EQ(snapped(near, model, 1e-12), model);
}

}  // namespace
}  // namespace angiospline
