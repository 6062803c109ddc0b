#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "kernel/evaluate/grid.h"
#include "kernel/refine/control_mesh.h"
#include "kernel/refine/refinement.h"
#include "kernel/refine/reshape.h"
#include "tests/shapes/random_splines.h"

namespace angiospline {
namespace {

// The polygon through (greville(i), control point i) is the linear spline over the Greville points.
Eigen::VectorXd hat_weights(const std::vector<double>& nodes, double t) {
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(nodes.size()));
  const auto above = std::upper_bound(nodes.begin(), nodes.end(), t);
  if (above == nodes.begin()) {
    weights(0) = 1;
  } else if (above == nodes.end()) {
    weights(weights.size() - 1) = 1;
  } else {
    const Eigen::Index i = above - nodes.begin();
    weights(i) = (t - *(above - 1)) / (*above - *(above - 1));
    weights(i - 1) = 1 - weights(i);
  }
  return weights;
}

double sampled_distance(const BSplineCurve<3>& curve) {
  const auto nodes = curve.knots().greville();
  double largest = 0;
  for (const double t : spaced(curve.knots().first(), curve.knots().last(), 400)) {
    const Eigen::Vector3d on_polygon = curve.control_points() * hat_weights(nodes, t);
    largest = std::max(largest, (on_polygon - curve.at(t)).norm());
  }
  return largest;
}

double sampled_distance(const BSplineSurface<3>& surface) {
  const auto us = surface.u().greville();
  const auto vs = surface.v().greville();
  double largest = 0;
  for (const double u : spaced(surface.u().first(), surface.u().last(), 60)) {
    const Eigen::VectorXd wu = hat_weights(us, u);
    for (const double v : spaced(surface.v().first(), surface.v().last(), 60)) {
      const Eigen::VectorXd wv = hat_weights(vs, v);
      Eigen::Vector3d mesh = Eigen::Vector3d::Zero();
      for (int i = 0; i < wu.size(); ++i) {
        for (int j = 0; wu(i) != 0 && j < wv.size(); ++j) {
          mesh += wu(i) * wv(j) * surface.control_point(i, j);
        }
      }
      largest = std::max(largest, (mesh - surface.at(u, v)).norm());
    }
  }
  return largest;
}

TEST(ControlPolygonDistance, IsNeverBelowWhatDenseSamplingSees) {
  Random random(1);
  double tightest = 0;
  for (int round = 0; round < 200; ++round) {
    const BSplineCurve<3> curve =
        random_curve<3>(random, random_knots(random, 1 + random.below(5), 0, false));
    const double bound = control_polygon_distance(curve);
    const double seen = sampled_distance(curve);
    EXPECT_LE(seen, bound + 1e-14);
    if (bound > 0) tightest = std::max(tightest, seen / bound);
  }
  EXPECT_GT(tightest, 0.2);  // and it is not far above it either
}

TEST(ControlMeshDistance, IsNeverBelowWhatDenseSamplingSees) {
  Random random(2);
  for (int round = 0; round < 12; ++round) {
    const BSplineSurface<3> surface =
        random_surface<3>(random, random_knots(random, 2 + random.below(3), 1, false),
                          random_knots(random, 2 + random.below(3), 1, false));
    EXPECT_LE(sampled_distance(surface), control_mesh_distance(surface) + 1e-14);
  }
}

TEST(RefineToTolerance, ChangesNoPointAndBringsTheMeshWithinTolerance) {
  Random random(3);
  for (int round = 0; round < 8; ++round) {
    const BSplineSurface<3> surface =
        random_surface<3>(random, random_knots(random, 2 + random.below(4), 2, false),
                          random_knots(random, 2 + random.below(4), 2, false));
    MeshOptions options;
    options.tolerance = 0.02;
    const auto refined = refine_to_tolerance(surface, options);
    ASSERT_TRUE(refined) << refined.error().message();
    EXPECT_LE(refined->distance, options.tolerance);
    EXPECT_LE(sampled_distance(refined->surface), refined->distance);
    const double u = random.uniform(surface.u().first(), surface.u().last());
    const double v = random.uniform(surface.v().first(), surface.v().last());
    EXPECT_LT((refined->surface.at(u, v) - surface.at(u, v)).norm(), 1e-13);
  }
}

TEST(RefineToTolerance, PutsKnotsWhereTheCurveBendsAndBeatsUniformRefinement) {
  // Straight for most of its length, a sharp bend at one place.
  const KnotVector knots = KnotVector::clamped(5, spaced(0, 1, 33));
  const auto nodes = knots.greville();
  Eigen::Matrix3Xd points(3, knots.control_point_count());
  for (int i = 0; i < points.cols(); ++i) {
    const double t = nodes[static_cast<std::size_t>(i)];
    points.col(i) << 10 * t, 2 * std::tanh(40 * (t - 0.3)), 0;
  }
  const BSplineCurve<3> curve(knots, points);
  MeshOptions options;
  options.tolerance = 1e-3;
  const auto refined = refine_to_tolerance(curve, options);
  ASSERT_TRUE(refined);
  EXPECT_LE(sampled_distance(refined->curve), options.tolerance);
  // Uniform: every span in k pieces, the least k whose bound is within the tolerance.
  int uniform = 0;
  for (int k = 1; uniform == 0; ++k) {
    const std::vector<double> breaks = knots.breakpoints();
    std::vector<double> cut;
    for (std::size_t i = 0; i + 1 < breaks.size(); ++i) {
      for (int j = 0; j < k; ++j) cut.push_back(breaks[i] + (breaks[i + 1] - breaks[i]) * j / k);
    }
    cut.push_back(breaks.back());
    const BSplineCurve<3> finer = rewrite(curve, KnotVector::clamped(5, cut));
    if (control_polygon_distance(finer) <= options.tolerance) {
      uniform = finer.knots().control_point_count();
    }
  }
  const int ours = refined->curve.knots().control_point_count();
  RecordProperty("control_points", ours);
  RecordProperty("uniform", uniform);
  EXPECT_LT(3 * ours, uniform) << ours << " against " << uniform;
}

// A circle bends alike everywhere: nothing to choose, and nothing to lose.
TEST(RefineToTolerance, NeedsNeverMoreThanCuttingEverySpanAlike) {
  Random random(6);
  int equal = 0;
  for (int round = 0; round < 20; ++round) {
    const KnotVector knots = round < 6 ? KnotVector::clamped(3 + round % 3, spaced(0, 1, 9))
                                       : random_knots(random, 2 + random.below(4), 1, false);
    BSplineCurve<3> curve = random_curve<3>(random, knots);
    if (round < 6) {
      Eigen::Matrix3Xd points(3, knots.control_point_count());
      for (int i = 0; i < points.cols(); ++i) {
        points.col(i) << std::cos(6 * knots.greville(i)), std::sin(6 * knots.greville(i)), 0;
      }
      curve = BSplineCurve<3>(knots, points);
    }
    MeshOptions options;
    options.tolerance = 1e-3;
    const auto refined = refine_to_tolerance(curve, options);
    ASSERT_TRUE(refined) << refined.error().message();
    EXPECT_LE(refined->distance, options.tolerance);
    const std::vector<double> breaks = knots.breakpoints();
    for (int k = 1;; ++k) {
      std::vector<double> added;
      for (std::size_t i = 0; i + 1 < breaks.size(); ++i) {
        for (int j = 1; j < k; ++j)
          added.push_back(breaks[i] + (breaks[i + 1] - breaks[i]) * j / k);
      }
      const BSplineCurve<3> uniform = *insert_knots(curve, added);
      if (control_polygon_distance(uniform) > options.tolerance) continue;
      const int count = uniform.knots().control_point_count();
      EXPECT_LE(refined->curve.knots().control_point_count(), count);
      equal += refined->curve.knots().control_point_count() == count ? 1 : 0;
      break;
    }
  }
  EXPECT_GT(equal, 0);
  EXPECT_LT(equal, 20);
}

// Where long spans meet short ones the bound is larger than on either side.
TEST(RefineToTolerance, EndsWhereTheBoundIsCloseToTheToleranceEverywhere) {
  Random random(5);
  for (int round = 0; round < 12; ++round) {
    const KnotVector knots = KnotVector::clamped(2 + random.below(4), spaced(0, 1, 60));
    const auto nodes = knots.greville();
    const double pace = random.uniform(3, 9);
    Eigen::Matrix3Xd points(3, knots.control_point_count());
    for (int i = 0; i < points.cols(); ++i) {
      const double t = nodes[static_cast<std::size_t>(i)];
      points.col(i) << std::cos(pace * t), std::sin(pace * t), t * t;
    }
    MeshOptions options;
    options.tolerance = 1e-4;
    const auto refined = refine_to_tolerance(BSplineCurve<3>(knots, points), options);
    ASSERT_TRUE(refined) << "round " << round << ": " << refined.error().message();
    EXPECT_LE(refined->distance, options.tolerance);
    EXPECT_LT(refined->curve.knots().control_point_count(), 4000);
  }
}

TEST(RefineToTolerance, RefusesWhatItCannotDo) {
  Random random(4);
  const BSplineCurve<3> curve = random_curve<3>(random, KnotVector::clamped(3, {0, 1, 2}));
  EXPECT_FALSE(refine_to_tolerance(curve, {}));
  MeshOptions options;
  options.tolerance = 1e-9;
  options.most_control_points = 1000;
  EXPECT_FALSE(refine_to_tolerance(curve, options));
  const BSplineCurve<3> jump = random_curve<3>(random, KnotVector::clamped(3, {0, 1, 2}, 4));
  options.tolerance = 0.1;
  const auto refused = refine_to_tolerance(jump, options);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message().find("jump"), std::string::npos);
}

}  // namespace
}  // namespace angiospline
