// Degenerate input and what is answered: the table of docs/kernel.md, line by line.
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "kernel/evaluate/closest_point.h"
#include "kernel/evaluate/curvature.h"
#include "kernel/evaluate/grid.h"
#include "kernel/evaluate/rational.h"
#include "kernel/fit/fit.h"
#include "kernel/reduce/reduce.h"
#include "kernel/refine/control_mesh.h"
#include "kernel/refine/refinement.h"
#include "kernel/refine/reshape.h"
#include "kernel/refine/split.h"
#include "kernel/spline/evaluator.h"
#include "tests/shapes/random_splines.h"

namespace angiospline {
namespace {

BSplineCurve<1> steps() {  // degree 0: 3 on [0, 1), 5 on [1, 2), -1 on [2, 4]
  const KnotVector knots = *KnotVector::make(0, {0, 1, 2, 4});
  return BSplineCurve<1>(knots, Eigen::RowVector3d(3, 5, -1));
}

TEST(Degenerate, DegreeZeroIsPiecewiseConstant) {
  const BSplineCurve<1> curve = steps();
  EXPECT_EQ(curve.at(0.5)(0), 3);
  EXPECT_EQ(curve.at(1)(0), 5);  // from the right
  EXPECT_EQ(curve.at(4)(0), -1);
  EXPECT_EQ(curve.at(0.5, 1)(0), 0);
  EXPECT_EQ(derivative(curve).at(0.5)(0), 0);
  EXPECT_EQ(insert_knots(curve, {0.5, 3})->at(3.5)(0), -1);
  EXPECT_EQ(elevate(curve, 2).at(1.5)(0), 5);
  EXPECT_EQ(split(curve, 1).first.at(0.3)(0), 3);
  EXPECT_EQ(bezier_pieces(curve).size(), 3u);
  const auto nearest = closest_point(curve, Eigen::Matrix<double, 1, 1>(4.8));
  EXPECT_EQ(nearest.point(0), 5);
  EXPECT_NEAR(nearest.distance, 0.2, 1e-15);
}

TEST(Degenerate, OneSpanIsLegalEverywhere) {
  Random random(1);
  for (int degree = 1; degree <= 7; ++degree) {
    const KnotVector knots = KnotVector::bezier(degree);
    const BSplineCurve<3> curve = random_curve<3>(random, knots);
    const BSplineSurface<3> surface = random_surface<3>(random, knots, knots);
    EXPECT_EQ(bezier_pieces(curve).size(), 1u);
    ReductionOptions options;
    options.tolerance = 1e-3;
    EXPECT_EQ(reduce(curve, options)->curve.knots(), knots);
    SurfaceReductionOptions both;
    both.tolerance = 1e-3;
    EXPECT_EQ(reduce(surface, both)->surface.u(), knots);
    const auto nodes = knots.greville();
    const auto again = interpolate<3>(knots, nodes, evaluate(curve, nodes));
    ASSERT_TRUE(again);
    EXPECT_LT((again->control_points() - curve.control_points()).norm(), 1e-12);
    EXPECT_LT((SurfaceEvaluator<3>(surface).point(0.3, 0.7) - surface.at(0.3, 0.7)).norm(), 1e-14);
  }
}

// Zero-length spans and multiplicity at the order: a jump, evaluated from the right.
TEST(Degenerate, AMultiplicityAtTheOrderIsAJump) {
  Random random(2);
  for (int degree = 1; degree <= 6; ++degree) {
    const KnotVector knots = KnotVector::clamped(degree, {0, 1, 2}, degree + 1);
    const BSplineCurve<3> curve = random_curve<3>(random, knots);
    EXPECT_EQ(curve.at(1), curve.control_points().col(degree + 1));
    EXPECT_LT((curve.at(std::nextafter(1, 0)) - curve.control_points().col(degree)).norm(), 1e-13);
    const auto parts = bezier_pieces(curve);
    ASSERT_EQ(parts.size(), 2u);
    EXPECT_EQ(parts[1].at(1), curve.at(1));
    EXPECT_LT((elevate(curve).at(1) - curve.at(1)).norm(), 1e-13);
    EXPECT_FALSE(with_knots(knots, {1}));  // it is full
    MeshOptions options;
    options.tolerance = 0.1;
    EXPECT_FALSE(refine_to_tolerance(curve, options));
    // A fit over such knots is two fits.
    const auto t = spaced(0, 2, 80);
    const auto fit = fit_curve<3>(knots, t, evaluate(curve, t));
    ASSERT_TRUE(fit) << fit.error().message();
    EXPECT_LT(fit->largest_residual, 1e-9);
    // Reduction leaves the jump.
    ReductionOptions reduction;
    reduction.tolerance = 1e-6;
    const auto reduced = reduce(*insert_knots(curve, {0.5, 1.5}), reduction);
    ASSERT_TRUE(reduced);
    EXPECT_EQ(reduced->curve.knots().multiplicity(1), degree + 1);
  }
}

TEST(Degenerate, CoincidentControlPointsAreLegal) {
  const KnotVector knots = KnotVector::clamped(5, spaced(0, 1, 30));
  const Eigen::Vector3d spot(1, 2, 3);
  const BSplineCurve<3> point(knots, spot.replicate(1, knots.control_point_count()));
  EXPECT_EQ(curvature(point, 0.4), 0);
  EXPECT_EQ(torsion(point, 0.4), 0);
  EXPECT_LT((point.at(0.4) - spot).norm(), 1e-14);
  const auto found = closest_point<3>(point, Eigen::Vector3d(1, 2, 5));
  EXPECT_NEAR(found.distance, 2, 1e-14);
  EXPECT_NEAR(found.lower_bound, 2, 1e-6);
  ReductionOptions options;
  options.tolerance = 1e-9;
  EXPECT_EQ(reduce(point, options)->curve.knots().control_point_count(), 6);
  EXPECT_LT(control_polygon_distance(point), 1e-14);
  // A surface whose side is one point: a pole.
  Eigen::Matrix3Xd net(3, 36);
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) net.col(i * 6 + j) << i * j, i * (5 - j), 0;
  }
  const KnotVector bezier = KnotVector::bezier(5);
  const BSplineSurface<3> pole(bezier, bezier, net);
  EXPECT_FALSE(fundamental_forms(surface_jet(pole, 0, 0.5)).regular);
  EXPECT_TRUE(fundamental_forms(surface_jet(pole, 0.5, 0.5)).regular);
  EXPECT_EQ(unit_normals(evaluate_grid(pole, {0}, {0.5}, 1)).col(0), Eigen::Vector3d::Zero());
  EXPECT_NEAR(closest_point<3>(pole, Eigen::Vector3d(0, 0, 1)).distance, 1, 1e-14);
}

TEST(Degenerate, KnotsThatBreakAnInvariantAreNamed) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const auto expect_named = [](const Result<KnotVector>& made, const char* what) {
    ASSERT_FALSE(made);
    EXPECT_NE(made.error().message().find(what), std::string::npos) << made.error().message();
  };
  expect_named(KnotVector::make(1, {0, 0, nan, 1, 1}), "knot 2");
  expect_named(KnotVector::make(1, {0, 0, 0.5, 1, infinity}), "knot 4");
  expect_named(KnotVector::make(1, {0, 0, 0, 1, 1}), "knot");
  EXPECT_FALSE(KnotVector::make(2, {0, 0, 0, 0, 0, 0}));  // no length
  EXPECT_FALSE(KnotVector::make(2, {0, 0, 1, 1}));        // too few
  EXPECT_FALSE(KnotVector::make(-1, {0, 1}));
  EXPECT_FALSE(KnotVector::make(KnotVector::kMaxDegree + 1, std::vector<double>(80, 0.0)));
}

TEST(Degenerate, DerivativesOfAnyOrderVanishBeyondTheDegree) {
  Random random(3);
  const KnotVector knots = KnotVector::clamped(3, {0, 0.5, 1});
  const BSplineCurve<3> curve = random_curve<3>(random, knots);
  const BSplineSurface<3> surface = random_surface<3>(random, knots, knots);
  EXPECT_GT(curve.at(0.3, 3).norm(), 0);
  SpanHint hint;
  for (const int order : {4, 7, 31, 40, 1000}) {
    EXPECT_EQ(curve.at(0.3, order), Eigen::Vector3d::Zero()) << order;
    EXPECT_EQ(surface.at(0.3, 0.6, hint, order, 1), Eigen::Vector3d::Zero()) << order;
    EXPECT_EQ(surface.at(0.3, 0.6, 1, order), Eigen::Vector3d::Zero()) << order;
  }
  EXPECT_EQ(hint.v, knots.span(0.6));
  // Rational ones do not end: 1 / (1 + t) has the derivatives (-1)^k k! / (1 + t)^(k + 1).
  Eigen::Matrix2Xd net(2, 2);
  net << 1, 1, 1, 2;  // weight 1 + t
  const BSplineCurve<2> hyperbola(KnotVector::bezier(1), net);
  const auto d = rational_derivatives<1>(hyperbola, 0.5, 40);
  double wanted = 1 / 1.5;
  for (int k = 0; k <= 40; ++k) {
    EXPECT_NEAR(d(0, k) / wanted, 1, 1e-12) << k;
    wanted *= -(k + 1) / 1.5;
  }
}

}  // namespace
}  // namespace angiospline
