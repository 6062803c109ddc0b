#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "kernel/continuity/triple_curve.h"
#include "kernel/evaluate/grid.h"
#include "kernel/fit/fit.h"
#include "kernel/refine/reshape.h"
#include "kernel/refine/split.h"
#include "kernel/spline/knot_algebra.h"
#include "tests/shapes/random_splines.h"

namespace angiospline {
namespace {

KnotVector thesis_knots() {  // (3.10)
  return KnotVector::clamped(5, {0, 0.5, 1}, 3);
}

TEST(TripleKnots, OfTheThesisExampleHaveOrder15AndMultiplicity13) {
  const KnotVector n = thesis_knots();
  const BSplineCurve<1> H(n, Eigen::RowVectorXd::Zero(n.control_point_count()));
  const KnotVector triple = triple_knots(n, n, derivative(H).knots());
  EXPECT_EQ(triple.order(), 15);
  const std::vector<Knot> wanted{{0, 15}, {0.5, 13}, {1, 15}};  // (3.11)
  EXPECT_EQ(distinct_knots(triple), wanted);
  EXPECT_EQ(triple.control_point_count(), 28);
}

TEST(TripleKnots, OfTwoSingleSpanQuinticsGiveFifteenNodes) {
  const KnotVector triple =
      triple_knots(KnotVector::bezier(5), KnotVector::bezier(5), KnotVector::bezier(4));
  EXPECT_EQ(triple.control_point_count(), 15);
}

TEST(TripleKnots, WithUnequalFactorsFollowTheLeastContinuous) {
  // Degrees 3, 5, 2: order 11. C1 at 0.3 in f alone, C4 at 0.6 in g, C1 at 0.6 in h.
  const KnotVector f = KnotVector::clamped(3, {0, 0.3, 1}, 2);
  const KnotVector g = KnotVector::clamped(5, {0, 0.6, 1}, 1);
  const KnotVector h = KnotVector::clamped(2, {0, 0.6, 1}, 1);
  const std::vector<Knot> wanted{{0, 11}, {0.3, 9}, {0.6, 9}, {1, 11}};
  EXPECT_EQ(distinct_knots(triple_knots(f, g, h)), wanted);
}

// Interpolation at the nodes, Morken's products and DeRose's sums are three forms of one spline.
TEST(TripleForms, AgreeOnRandomPatches) {
  Random random(1);
  int bezier_rounds = 0;
  for (int round = 0; round < 60; ++round) {
    const bool bezier = round % 2 == 0;
    const auto knots = [&](int degree) {
      return bezier ? KnotVector::bezier(degree)
                    : with_domain(random_knots(random, degree, degree - 1, false), 0, 1);
    };
    const int degree = 2 + random.below(4);
    const BSplineCurve<3> F = random_curve<3>(random, knots(degree));
    const BSplineCurve<3> G = random_curve<3>(random, knots(2 + random.below(4)));
    const BSplineCurve<3> H = random_curve<3>(random, knots(2 + random.below(3)));
    const BSplineCurve<1> morken = triple_product(F, G, H);
    const KnotVector space = triple_knots(F.knots(), G.knots(), H.knots());
    ASSERT_EQ(morken.knots(), space);
    const std::vector<double> nodes = space.greville();
    Eigen::Matrix<double, 1, Eigen::Dynamic> values(1, space.control_point_count());
    for (int i = 0; i < values.cols(); ++i) {
      values(i) = triple_value(F, G, H, nodes[static_cast<std::size_t>(i)]);
    }
    const auto interpolated = interpolate<1>(space, nodes, values);
    ASSERT_TRUE(interpolated) << interpolated.error().message();
    // Degree 14 interpolation amplifies rounding by its condition number.
    EXPECT_LT((interpolated->control_points() - morken.control_points()).cwiseAbs().maxCoeff(),
              1e-9);
    for (int k = 0; k < 5; ++k) {
      const double t = random.uniform();
      EXPECT_NEAR(morken.at(t)(0), triple_value(F, G, H, t), 1e-13);
    }
    if (bezier) {
      const BSplineCurve<1> derose = triple_derose(F, G, H);
      EXPECT_EQ(derose.knots(), morken.knots());
      EXPECT_LT((derose.control_points() - morken.control_points()).cwiseAbs().maxCoeff(), 1e-13);
      ++bezier_rounds;
    }
  }
  EXPECT_EQ(bezier_rounds, 30);
}

struct Pair {
  BSplineSurface<3> a, b;
};

TEST(TripleCurve, VanishesWhereOneSmoothSurfaceIsCutInTwo) {
  Random random(2);
  const BSplineSurface<3> whole =
      random_surface<3>(random, KnotVector::bezier(5), KnotVector::clamped(5, {0, 0.5, 1}, 3));
  const auto [a, b] = split_u(whole, 0.4);
  const TripleCurve curve(a, SurfaceSide::kU1, b, SurfaceSide::kU0, SideDirection::kSame);
  EXPECT_EQ(curve.nodes().size(), 28u);
  EXPECT_LT(curve.evaluate(a, b).values.cwiseAbs().maxCoeff(), 1e-12);
  // Turned round and sideways it is the same boundary.
  const BSplineSurface<3> turned = swap_uv(reverse_v(b));
  const TripleCurve sideways(a, SurfaceSide::kU1, turned, SurfaceSide::kV0,
                             SideDirection::kReversed);
  EXPECT_LT(sideways.evaluate(a, turned).values.cwiseAbs().maxCoeff(), 1e-12);
  // A kink shows.
  auto net = b.control_points();
  net.col(b.index(1, 2)) += Vec3(0, 0, 0.1);
  const BSplineSurface<3> kinked(b.u(), b.v(), net);
  EXPECT_GT(curve.evaluate(a, kinked).values.cwiseAbs().maxCoeff(), 1e-3);
}

TEST(TripleCurve, GradientsAgreeWithFiniteDifferences) {
  Random random(3);
  const SurfaceSide sides[] = {SurfaceSide::kU0, SurfaceSide::kU1, SurfaceSide::kV0,
                               SurfaceSide::kV1};
  int checked = 0;
  for (int round = 0; round < 16; ++round) {
    const SurfaceSide side_a = sides[round % 4];
    const SurfaceSide side_b = sides[round / 4];
    const auto surface = [&](SurfaceSide side) {
      const KnotVector across = KnotVector::clamped(3, {0, 0.6, 2});
      const KnotVector along = KnotVector::clamped(3, {0, 0.5, 1}, 1 + round % 2);
      const bool along_v = side == SurfaceSide::kU0 || side == SurfaceSide::kU1;
      return random_surface<3>(random, along_v ? across : along, along_v ? along : across);
    };
    Pair pair{surface(side_a), surface(side_b)};
    const TripleCurve curve(pair.a, side_a, pair.b, side_b,
                            round % 3 == 0 ? SideDirection::kReversed : SideDirection::kSame);
    const TripleValues at = curve.evaluate(pair.a, pair.b);
    // The dense Jacobian, then each column by a central difference (Phi is cubic at most).
    for (int which = 0; which < 2; ++which) {
      const BSplineSurface<3>& base = which == 0 ? pair.a : pair.b;
      for (Eigen::Index point = 0; point < base.control_points().cols(); ++point) {
        for (int axis = 0; axis < 3; ++axis) {
          const auto moved = [&](double by) {
            auto net = base.control_points();
            net(axis, point) += by;
            const BSplineSurface<3> other(base.u(), base.v(), net);
            return which == 0 ? curve.evaluate(other, pair.b).values
                              : curve.evaluate(pair.a, other).values;
          };
          const double h = 1e-4;
          const Eigen::VectorXd difference = (moved(h) - moved(-h)) / (2 * h);
          Eigen::VectorXd gradient = Eigen::VectorXd::Zero(at.values.size());
          for (const TripleGradient& g : at.gradient) {
            if (g.surface == which && g.point == point) gradient(g.node) += g.gradient(axis);
          }
          const double scale = 1 + difference.cwiseAbs().maxCoeff();
          EXPECT_LT((gradient - difference).cwiseAbs().maxCoeff(), 1e-5 * scale);
          if (gradient.cwiseAbs().maxCoeff() > 0.1) ++checked;
        }
      }
    }
  }
  EXPECT_GT(checked, 200);
}

TEST(EdgeCurves, AreTheSurfaceAndItsDerivativesAlongTheSide) {
  Random random(4);
  for (int round = 0; round < 40; ++round) {
    const KnotVector u = random_knots(random, 2 + random.below(4));
    const KnotVector v = random_knots(random, 2 + random.below(4));
    const BSplineSurface<3> s = random_surface<3>(random, u, v);
    const double a = random.uniform(u.first(), u.last());
    const double b = random.uniform(v.first(), v.last());
    EXPECT_LT((boundary_curve(s, SurfaceSide::kU0).at(b) - s.at(u.first(), b)).norm(), 1e-14);
    EXPECT_LT((boundary_curve(s, SurfaceSide::kV1).at(a) - s.at(a, v.last())).norm(), 1e-14);
    const auto near = [](const Vec3& x, const Vec3& y) {
      return (x - y).norm() <= 1e-12 * (1 + y.norm());
    };
    EXPECT_TRUE(near(cross_derivative_curve(s, SurfaceSide::kU1).at(b), s.at(u.last(), b, 1, 0)));
    EXPECT_TRUE(near(cross_derivative_curve(s, SurfaceSide::kV0).at(a), s.at(a, v.first(), 0, 1)));
    EXPECT_TRUE(
        near(cross_derivative_curve(s, SurfaceSide::kV0, 2).at(a), s.at(a, v.first(), 0, 2)));
    EXPECT_TRUE(
        near(derivative(boundary_curve(s, SurfaceSide::kU0)).at(b), s.at(u.first(), b, 0, 1)));
  }
}

}  // namespace
}  // namespace angiospline
