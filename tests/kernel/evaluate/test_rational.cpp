// Rational curves and surfaces in the verbs: what is done to the homogeneous form holds for the
// projected one.
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "kernel/evaluate/curvature.h"
#include "kernel/evaluate/grid.h"
#include "kernel/evaluate/rational.h"
#include "kernel/reduce/reduce.h"
#include "kernel/refine/control_mesh.h"
#include "kernel/refine/periodic.h"
#include "kernel/refine/refinement.h"
#include "kernel/refine/reshape.h"
#include "kernel/refine/split.h"
#include "tests/shapes/random_splines.h"

namespace angiospline {
namespace {

constexpr double kRadius = 7;

// A circle of four rational quarters, (x, y, 3, 1) w, far from the origin in z.
BSplineCurve<4> circle() {
  const double h = std::sqrt(0.5);
  Eigen::Matrix2Xd corners(2, 9);
  corners << 1, 1, 0, -1, -1, -1, 0, 1, 1, 0, 1, 1, 1, 0, -1, -1, -1, 0;
  Eigen::Matrix3Xd points(3, 9);
  points << kRadius * corners, Eigen::RowVectorXd::Constant(9, 3);
  Eigen::VectorXd weights(9);
  weights << 1, h, 1, h, 1, h, 1, h, 1;
  return BSplineCurve<4>(KnotVector::clamped(2, {0, 1, 2, 3, 4}, 2),
                         homogeneous<3>(points, weights));
}

// The circle swept along z.
BSplineSurface<4> cylinder() {
  const BSplineCurve<4> c = circle();
  Eigen::Matrix4Xd net(4, 27);
  for (int i = 0; i < 9; ++i) {
    for (int j = 0; j < 3; ++j) {
      net.col(i * 3 + j) = c.control_points().col(i);
      net(2, i * 3 + j) += 4.0 * j * net(3, i * 3 + j);
    }
  }
  return BSplineSurface<4>(c.knots(), KnotVector::clamped(1, {0, 1, 2}), net);
}

void expect_on_circle(const BSplineCurve<4>& curve, double tolerance = 1e-12) {
  for (const double t : spaced(curve.knots().first(), curve.knots().last(), 57)) {
    const Eigen::Vector3d p = rational_derivatives<3>(curve, t, 0).col(0);
    EXPECT_NEAR(p.head<2>().norm(), kRadius, tolerance);
    EXPECT_NEAR(p.z(), 3, tolerance);
  }
}

TEST(RationalCurve, StaysACircleInEveryVerb) {
  const BSplineCurve<4> c = circle();
  expect_on_circle(c);
  expect_on_circle(*insert_knots(c, {0.3, 1.5, 2.7}));
  expect_on_circle(elevate(c, 3));
  expect_on_circle(reverse(c));
  expect_on_circle(over(c, -1, 1));
  expect_on_circle(restrict_to(c, 0.2, 3.1));
  expect_on_circle(split(c, 1.6).second);
  for (const auto& piece : bezier_pieces(c)) expect_on_circle(piece);
  const auto [first, second] = split(c, 2.2);
  expect_on_circle(*join(first, second, 1e-12));
  for (const auto& curve : make_compatible<4>({c, elevate(c)})) expect_on_circle(curve);
  for (const double t : {0.0, 0.4, 1.0, 3.3}) {
    EXPECT_NEAR(curvature(c, t), 1 / kRadius, 1e-12);
    EXPECT_NEAR(torsion(c, t), 0, 1e-12);
  }
}

TEST(RationalCurve, ReducedStaysWithinTheToleranceOfItsProjection) {
  const BSplineCurve<4> c = circle();
  // Many knots, all of which carry nothing: the circle comes back.
  const BSplineCurve<4> fine = *insert_knots(elevate(c), spaced(0.013, 3.987, 90));
  for (const double tolerance : {1e-2, 1e-6}) {
    ReductionOptions options;
    options.tolerance = tolerance;
    const auto reduced = reduce_rational<3>(fine, options);
    ASSERT_TRUE(reduced) << reduced.error().message();
    EXPECT_LE(reduced->error_bound, tolerance);
    EXPECT_LE(reduced->curve.knots().control_point_count(),
              elevate(c).knots().control_point_count());
    double error = 0;
    for (const double t : spaced(0, 4, 1001)) {
      error = std::max(error, (rational_derivatives<3>(fine, t, 0) -
                               rational_derivatives<3>(reduced->curve, t, 0))
                                  .norm());
    }
    EXPECT_LE(error, reduced->error_bound + 1e-13);
    EXPECT_LT((rational_derivatives<3>(fine, 0, 0) - rational_derivatives<3>(reduced->curve, 0, 0))
                  .norm(),
              1e-12);
  }
  EXPECT_FALSE(reduce_rational<3>(c, {}));
}

// Weights that differ widely, where a bound on homogeneous coordinates alone would be none.
TEST(RationalCurve, ReductionHoldsItsPromiseForWildWeights) {
  Random random(1);
  int removed = 0;
  for (int round = 0; round < 30; ++round) {
    const KnotVector knots = KnotVector::clamped(3, spaced(0, 1, 80));
    const auto nodes = knots.greville();
    Eigen::Matrix2Xd points(2, knots.control_point_count());
    Eigen::VectorXd weights(points.cols());
    const double pace = random.uniform(2, 6);
    for (int i = 0; i < points.cols(); ++i) {
      const double t = nodes[static_cast<std::size_t>(i)];
      points.col(i) << 100 + std::cos(pace * t), std::sin(pace * t);
      weights(i) = std::exp(2 * std::sin(pace * t + round));
    }
    const BSplineCurve<3> curve(knots, homogeneous<2>(points, weights));
    ReductionOptions options;
    options.tolerance = 1e-2;
    const auto reduced = reduce_rational<2>(curve, options);
    ASSERT_TRUE(reduced) << reduced.error().message();
    removed += knots.control_point_count() - reduced->curve.knots().control_point_count();
    for (const double t : spaced(0, 1, 300)) {
      EXPECT_LE(
          (rational_derivatives<2>(curve, t, 0) - rational_derivatives<2>(reduced->curve, t, 0))
              .norm(),
          reduced->error_bound + 1e-12);
    }
  }
  EXPECT_GT(removed, 30 * 20);
}

TEST(RationalCurve, RefinedUntilItsProjectedPolygonIsClose) {
  MeshOptions options;
  options.tolerance = 1e-2;
  const auto refined = refine_to_tolerance_rational<3>(circle(), options);
  ASSERT_TRUE(refined) << refined.error().message();
  EXPECT_LE(refined->distance, 1e-2);
  expect_on_circle(refined->curve);
  const Eigen::Matrix3Xd polygon = projected<3>(refined->curve.control_points());
  for (Eigen::Index i = 0; i + 1 < polygon.cols(); ++i) {
    for (const double s : {0.0, 0.3, 0.5}) {
      const Eigen::Vector3d p = (1 - s) * polygon.col(i) + s * polygon.col(i + 1);
      EXPECT_NEAR(p.head<2>().norm(), kRadius, refined->distance);
    }
  }
}

TEST(RationalSurface, StaysACylinderInEveryVerb) {
  const BSplineSurface<4> s = cylinder();
  const auto expect_wall = [](const BSplineSurface<4>& of) {
    const SurfaceGrid<3> grid =
        projected<3>(evaluate_grid(of, spaced(of.u().first(), of.u().last(), 23),
                                   spaced(of.v().first(), of.v().last(), 9), 2));
    for (Eigen::Index k = 0; k < grid.points().cols(); ++k) {
      EXPECT_NEAR(grid.points().col(k).head<2>().norm(), kRadius, 1e-12);
      EXPECT_NEAR(grid.partial(1, 0).col(k).dot(grid.points().col(k) -
                                                Eigen::Vector3d(0, 0, grid.points()(2, k))),
                  0, 1e-10);
    }
  };
  expect_wall(s);
  expect_wall(elevate(s, 1, 2));
  expect_wall(reverse_u(reverse_v(s)));
  expect_wall(split_u(s, 1.3).first);
  expect_wall(split_v(s, 0.4).second);
  expect_wall(refine(s, *with_knots(s.u(), {0.2, 3}), *with_knots(s.v(), {0.7})));
  for (const auto& piece : bezier_pieces(s)) expect_wall(piece);
  MeshOptions mesh;
  mesh.tolerance = 0.05;
  const auto refined = refine_to_tolerance_rational<3>(s, mesh);
  ASSERT_TRUE(refined) << refined.error().message();
  expect_wall(refined->surface);
  SurfaceReductionOptions options;
  options.tolerance = 1e-6;
  const auto reduced = reduce_rational<3>(refine(s, *with_knots(s.u(), spaced(0.01, 3.99, 30)),
                                                 *with_knots(s.v(), spaced(0.03, 1.97, 15))),
                                          options);
  ASSERT_TRUE(reduced) << reduced.error().message();
  EXPECT_LE(reduced->surface.control_points().cols(), s.control_points().cols());
  const auto us = spaced(0, 4, 41);
  const auto vs = spaced(0, 2, 11);
  EXPECT_LE((projected<3>(evaluate_grid(s, us, vs)).points() -
             projected<3>(evaluate_grid(reduced->surface, us, vs)).points())
                .colwise()
                .norm()
                .maxCoeff(),
            1e-6);
}

// A rational circle without a seam: uniform quintic, closed, weights that vary round it.
TEST(RationalCurve, ClosedOnesStayClosedWhenReduced) {
  std::vector<Knot> period;
  for (int k = 0; k < 200; ++k) period.push_back({k / 200.0, 1});
  const KnotVector knots = *periodic_knots(5, period, 1);
  Eigen::Matrix4Xd distinct(4, 200);
  for (int i = 0; i < 200; ++i) {
    const double a = 2 * std::numbers::pi * (i + 0.5) / 200;
    const double w = 1 + 0.3 * std::cos(2 * a);
    distinct.col(i) << w * std::cos(a), w * std::sin(a), w * 0.2 * std::sin(3 * a), w;
  }
  const BSplineCurve<4> curve = periodic_curve<4>(knots, distinct);
  ReductionOptions options;
  options.tolerance = 1e-3;
  options.held_first = options.held_last = 0;
  const auto reduced = reduce_rational<3>(curve, options);
  ASSERT_TRUE(reduced) << reduced.error().message();
  EXPECT_TRUE(is_periodic(reduced->curve));
  EXPECT_LT(*periodic_count(reduced->curve.knots()), 60);
  for (const double t : spaced(0, 1, 400)) {
    EXPECT_LE((rational_derivatives<3>(curve, t, 0) - rational_derivatives<3>(reduced->curve, t, 0))
                  .norm(),
              reduced->error_bound + 1e-12);
  }
}

}  // namespace
}  // namespace angiospline
