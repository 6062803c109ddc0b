// Laws that hold for every spline, over random families of them.
#include <cmath>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "kernel/evaluate/curvature.h"
#include "kernel/evaluate/grid.h"
#include "kernel/fit/fit.h"
#include "kernel/reduce/reduce.h"
#include "kernel/refine/refinement.h"
#include "kernel/refine/reshape.h"
#include "kernel/refine/split.h"
#include "tests/shapes/random_splines.h"

namespace angiospline {
namespace {

// x -> linear * x + shift.
struct Affine {
  Eigen::Matrix3d linear;
  Eigen::Vector3d shift;

  Eigen::Matrix3Xd operator()(const Eigen::Matrix3Xd& points) const {
    return (linear * points).colwise() + shift;
  }
  BSplineCurve<3> operator()(const BSplineCurve<3>& c) const {
    return BSplineCurve<3>(c.knots(), (*this)(c.control_points()));
  }
  BSplineSurface<3> operator()(const BSplineSurface<3>& s) const {
    return BSplineSurface<3>(s.u(), s.v(), (*this)(s.control_points()));
  }
};

Affine random_affine(Random& random) {
  Affine map;
  for (int i = 0; i < 9; ++i) map.linear.data()[i] = random.uniform(-2, 2);
  for (int i = 0; i < 3; ++i) map.shift(i) = random.uniform(-5, 5);
  return map;
}

// A rotation, a scale and a shift.
Affine random_similarity(Random& random, double scale) {
  const Eigen::Vector3d axis(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(0.1, 1));
  return {scale * Eigen::AngleAxisd(random.uniform(0, 6), axis.normalized()).toRotationMatrix(),
          {random.uniform(-5, 5), random.uniform(-5, 5), random.uniform(-5, 5)}};
}

TEST(BasisLaws, FunctionsAreNotNegativeAndSumToOneWithDerivativesThatSumToZero) {
  Random random(1);
  for (int round = 0; round < 300; ++round) {
    const KnotVector knots = random_knots(random, random.below(9), 9);
    const double t = random_parameter(random, knots);
    const BasisValues basis = basis_at(knots, t, 3);
    EXPECT_GE(basis.values.row(0).minCoeff(), -1e-15);
    EXPECT_NEAR(basis.values.row(0).sum(), 1, 1e-14);
    for (int d = 1; d <= 3; ++d) {
      EXPECT_NEAR(basis.values.row(d).sum(), 0, 1e-13 * (1 + basis.values.row(d).norm()));
    }
  }
}

TEST(BasisLaws, LinearFunctionsAreReproducedByTheGrevilleAbscissae) {
  Random random(2);
  for (int round = 0; round < 200; ++round) {
    const KnotVector knots = random_knots(random, 1 + random.below(8));
    const double t = random_parameter(random, knots);
    const BasisValues basis = basis_at(knots, t, 1);
    double value = 0;
    double slope = 0;
    for (int j = 0; j < knots.order(); ++j) {
      value += basis.values(0, j) * knots.greville(basis.first + j);
      slope += basis.values(1, j) * knots.greville(basis.first + j);
    }
    EXPECT_NEAR(value, t, 1e-13 * (1 + std::abs(t)));
    EXPECT_NEAR(slope, 1, 1e-9);
  }
}

TEST(AffineInvariance, HoldsForEvaluationRefinementElevationAndSplitting) {
  Random random(3);
  for (int round = 0; round < 80; ++round) {
    const Affine map = random_affine(random);
    const KnotVector u = random_knots(random, 1 + random.below(6));
    const KnotVector v = random_knots(random, 1 + random.below(6));
    const BSplineCurve<3> curve = random_curve<3>(random, u);
    const BSplineSurface<3> surface = random_surface<3>(random, u, v);
    const double s = random_parameter(random, u);
    const double t = random_parameter(random, v);
    const auto near = [](const Eigen::Matrix3Xd& a, const Eigen::Matrix3Xd& b) {
      return (a - b).norm() <= 1e-11 * (1 + b.norm());
    };
    EXPECT_TRUE(near(map(curve).at(s), map(Eigen::Matrix3Xd(curve.at(s)))));
    EXPECT_TRUE(near(map(curve).at(s, 1), map.linear * curve.at(s, 1)));
    EXPECT_TRUE(near(map(surface).at(s, t), map(Eigen::Matrix3Xd(surface.at(s, t)))));
    EXPECT_TRUE(near(map(surface).at(s, t, 1, 1), map.linear * surface.at(s, t, 1, 1)));
    const auto added = random_new_knots(random, u, 5);
    EXPECT_TRUE(near(insert_knots(map(curve), added)->control_points(),
                     map(*insert_knots(curve, added)).control_points()));
    // Control points beyond a floating end may be far away and cancel; the points do not.
    EXPECT_TRUE(near(elevate(map(curve), 2).at(s), map(elevate(curve, 2)).at(s)));
    EXPECT_TRUE(near(elevate(map(surface), 1, 1).at(s, t), map(elevate(surface, 1, 1)).at(s, t)));
    const double cut = u.first() + 0.4 * (u.last() - u.first());
    EXPECT_TRUE(near(split_u(map(surface), cut).first.control_points(),
                     map(split_u(surface, cut).first).control_points()));
  }
}

// A fit is a linear map of its data that reproduces constants.
TEST(AffineInvariance, HoldsForInterpolationAndLeastSquares) {
  Random random(4);
  for (int round = 0; round < 40; ++round) {
    const Affine map = random_affine(random);
    const KnotVector knots = random_knots(random, 2 + random.below(4), 1, false);
    const auto nodes = knots.greville();
    const BSplineCurve<3> curve = random_curve<3>(random, knots);
    const Eigen::Matrix3Xd points = curve.control_points();
    const auto before = interpolate<3>(knots, nodes, points);
    const auto after = interpolate<3>(knots, nodes, map(points));
    ASSERT_TRUE(before && after);
    const double size = 1 + after->control_points().norm();
    EXPECT_LT((after->control_points() - map(*before).control_points()).norm(), 1e-9 * size);
    const auto dense = spaced(knots.first(), knots.last(), 200);
    Eigen::Matrix3Xd noisy = evaluate(curve, dense);
    for (Eigen::Index i = 0; i < noisy.size(); ++i) noisy.data()[i] += random.uniform(-0.1, 0.1);
    const auto fit = fit_curve<3>(knots, dense, noisy);
    const auto mapped = fit_curve<3>(knots, dense, map(noisy));
    if (!fit) continue;  // a span too short for the samples
    ASSERT_TRUE(mapped);
    EXPECT_LT((mapped->curve.control_points() - map(fit->curve).control_points()).norm(),
              1e-7 * (1 + mapped->curve.control_points().norm()));
  }
}

// A power of two and a mirror image lose no bit, so that the search itself, with all its
// comparisons, must run the same way; lengths scale, so do tolerances.
TEST(AffineInvariance, OfReductionHoldsForScaleWithTheTolerance) {
  Random random(5);
  const Eigen::Matrix3d mirror = Eigen::Vector3d(-1, 1, -1).asDiagonal();
  for (int round = 0; round < 12; ++round) {
    const KnotVector knots = KnotVector::clamped(2 + random.below(4), spaced(0, 1, 60));
    const auto nodes = knots.greville();
    Eigen::Matrix3Xd points(3, knots.control_point_count());
    const double pace = random.uniform(3, 9);
    for (int i = 0; i < points.cols(); ++i) {
      const double t = nodes[static_cast<std::size_t>(i)];
      points.col(i) << std::cos(pace * t), std::sin(pace * t), t * t;
    }
    const BSplineCurve<3> curve(knots, points);
    for (const double scale : {0x1p-20, 0x1p+20}) {
      const Affine map{scale * mirror, Eigen::Vector3d::Zero()};
      ReductionOptions options;
      options.tolerance = 1e-3;
      const auto reduced = reduce(curve, options);
      options.tolerance *= scale;
      const auto mapped = reduce(map(curve), options);
      ASSERT_TRUE(reduced && mapped);
      EXPECT_LT(reduced->curve.knots().control_point_count(), 40);
      EXPECT_EQ(mapped->curve.knots(), reduced->curve.knots());
      EXPECT_LT((mapped->curve.control_points() - map(reduced->curve).control_points()).norm(),
                1e-12 * scale);
    }
  }
}

TEST(Similarity, ScalesPrincipalCurvaturesByItsInverse) {
  Random random(6);
  int checked = 0;
  for (int round = 0; round < 60; ++round) {
    const BSplineSurface<3> surface =
        random_surface<3>(random, random_knots(random, 2 + random.below(4), 1),
                          random_knots(random, 2 + random.below(4), 1));
    const double scale = std::exp(random.uniform(-4, 4));
    const Affine map = random_similarity(random, scale);
    const double u = random.uniform(surface.u().first(), surface.u().last());
    const double v = random.uniform(surface.v().first(), surface.v().last());
    const auto before = principal_curvatures(surface_jet(surface, u, v));
    const auto after = principal_curvatures(surface_jet(map(surface), u, v));
    const double size = 1 + std::abs(before.largest) + std::abs(before.smallest);
    if (!(size < 1e4)) continue;  // a point that is nearly singular
    EXPECT_NEAR(scale * after.largest, before.largest, 1e-6 * size);
    EXPECT_NEAR(scale * after.smallest, before.smallest, 1e-6 * size);
    ++checked;
  }
  EXPECT_GT(checked, 40);
}

// Central differences inside a span, for every derivative from the one before it.
TEST(Derivatives, OfSurfacesOfAllDegreesAgreeWithFiniteDifferences) {
  Random random(7);
  for (int round = 0; round < 100; ++round) {
    const KnotVector u = random_knots(random, 1 + random.below(7));
    const KnotVector v = random_knots(random, 1 + random.below(7));
    const BSplineSurface<3> s = random_surface<3>(random, u, v);
    const auto inside = [&](const KnotVector& knots) {
      int span = knots.span(random.uniform(knots.first(), knots.last()));
      return std::pair(knots[span] + 0.5 * (knots[span + 1] - knots[span]),
                       1e-4 * (knots[span + 1] - knots[span]));
    };
    const auto [a, ha] = inside(u);
    const auto [b, hb] = inside(v);
    for (int i = 0; i <= 3; ++i) {
      for (int j = 0; j <= 3; ++j) {
        const Eigen::Vector3d by_u = (s.at(a + ha, b, i, j) - s.at(a - ha, b, i, j)) / (2 * ha);
        const Eigen::Vector3d by_v = (s.at(a, b + hb, i, j) - s.at(a, b - hb, i, j)) / (2 * hb);
        const double value = s.at(a, b, i, j).norm();
        const Eigen::Vector3d wanted_u = s.at(a, b, i + 1, j);
        const Eigen::Vector3d wanted_v = s.at(a, b, i, j + 1);
        EXPECT_LE((by_u - wanted_u).norm(), 1e-5 * (wanted_u.norm() + 1e-4 * value / ha));
        EXPECT_LE((by_v - wanted_v).norm(), 1e-5 * (wanted_v.norm() + 1e-4 * value / hb));
      }
    }
  }
}

// Knots of any multiplicity inserted and taken out again leave the curve as it was.
TEST(InsertThenRemove, IsTheIdentity) {
  Random random(9);
  for (int round = 0; round < 40; ++round) {
    const KnotVector knots = random_knots(random, 2 + random.below(4), 2, false);
    const BSplineCurve<3> curve = random_curve<3>(random, knots);
    const auto fine = insert_knots(curve, random_new_knots(random, knots, 1 + random.below(15)));
    ASSERT_TRUE(fine);
    ReductionOptions options;
    options.tolerance = 1e-9;
    const auto back = reduce(*fine, options);
    ASSERT_TRUE(back) << back.error().message();
    ASSERT_EQ(back->curve.knots(), knots) << "round " << round;
    EXPECT_LT((back->curve.control_points() - curve.control_points()).cwiseAbs().maxCoeff(), 1e-8);
  }
}

TEST(SpanHint, NeverChangesTheValueAndHoldsTheSpansFound) {
  Random random(8);
  for (int round = 0; round < 100; ++round) {
    const KnotVector u = random_knots(random, 1 + random.below(6));
    const KnotVector v = random_knots(random, 1 + random.below(6));
    const BSplineSurface<3> s = random_surface<3>(random, u, v);
    SpanHint hint{random.below(40) - 10, random.below(40) - 10};  // right, wrong or out of range
    for (int k = 0; k < 20; ++k) {
      const double a = random_parameter(random, u);
      const double b = random_parameter(random, v);
      const int du = random.below(3);
      const int dv = random.below(3);
      EXPECT_EQ(s.at(a, b, hint, du, dv), s.at(a, b, du, dv));
      EXPECT_EQ(hint.u, u.span(a));
      EXPECT_EQ(hint.v, v.span(b));
    }
  }
}

}  // namespace
}  // namespace angiospline
