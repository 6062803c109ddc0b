#include <cmath>

#include <gtest/gtest.h>

#include "kernel/refine/refinement.h"
#include "kernel/refine/split.h"
#include "tests/shapes/random_splines.h"

namespace angiospline {
namespace {

constexpr double kEpsilon = 2.3e-16;

TEST(RefinementMatrix, ThreeAlgorithmsAgreeToAFewUlpsOverRandomKnotVectors) {
  Random random(1);
  int refined = 0;
  double worst = 0;
  for (int round = 0; round < 3000; ++round) {
    const int degree = random.below(8);
    const KnotVector coarse = random_knots(random, degree, degree + 1);
    const auto fine = with_knots(coarse, random_new_knots(random, coarse, random.below(20)));
    ASSERT_TRUE(fine) << fine.error().message();
    const Eigen::MatrixXd improved = refinement_matrix(coarse, *fine).to_dense();
    const Eigen::MatrixXd oslo = refinement_matrix_oslo(coarse, *fine).to_dense();
    const Eigen::MatrixXd boehm = refinement_matrix_boehm(coarse, *fine).to_dense();
    worst = std::max(
        {worst, (improved - oslo).cwiseAbs().maxCoeff(), (improved - boehm).cwiseAbs().maxCoeff()});
    ASSERT_LE(worst, 16 * kEpsilon) << "degree " << degree << ", round " << round;
    ASSERT_GE(improved.minCoeff(), 0.0);
    refined += fine->control_point_count() - coarse.control_point_count();
  }
  EXPECT_GT(refined, 10000);
}

TEST(RefinementMatrix, RowsSumToOneOnClampedKnots) {
  Random random(2);
  for (int round = 0; round < 300; ++round) {
    const KnotVector coarse = random_knots(random, 1 + random.below(7), 0, false);
    const KnotVector fine = *with_knots(coarse, random_new_knots(random, coarse, 12));
    const Eigen::VectorXd sums = refinement_matrix(coarse, fine).to_dense().rowwise().sum();
    EXPECT_LT((sums.array() - 1).abs().maxCoeff(), 8 * kEpsilon);
  }
}

TEST(Refine, ChangesNoPointOfACurve) {
  Random random(3);
  for (int round = 0; round < 500; ++round) {
    const KnotVector knots = random_knots(random, random.below(8));
    const BSplineCurve<3> curve = random_curve<3>(random, knots);
    const auto fine = insert_knots(curve, random_new_knots(random, knots, 15));
    ASSERT_TRUE(fine) << fine.error().message();
    for (int k = 0; k < 20; ++k) {
      const double t = random_parameter(random, knots);
      if (knots.degree() == 0 && knots.multiplicity(t) > 0) continue;
      EXPECT_LT((curve.at(t) - fine->at(t)).norm(), 1e-14) << "degree " << knots.degree();
    }
  }
}

TEST(Refine, ChangesNoPointOfASurfaceInEitherDirection) {
  Random random(4);
  for (int round = 0; round < 100; ++round) {
    const KnotVector u = random_knots(random, 1 + random.below(6));
    const KnotVector v = random_knots(random, 1 + random.below(6));
    const BSplineSurface<3> surface = random_surface<3>(random, u, v);
    const auto fine = refine(surface, *with_knots(u, random_new_knots(random, u, 9)),
                             *with_knots(v, random_new_knots(random, v, 7)));
    for (int k = 0; k < 20; ++k) {
      const double s = random_parameter(random, u);
      const double t = random_parameter(random, v);
      EXPECT_LT((surface.at(s, t) - fine.at(s, t)).norm(), 1e-14);
    }
  }
}

TEST(Refine, ThreeAlgorithmsAgreeOnSurfacesInBothDirections) {
  Random random(8);
  for (int round = 0; round < 60; ++round) {
    const KnotVector u = random_knots(random, 1 + random.below(6));
    const KnotVector v = random_knots(random, 1 + random.below(6));
    const KnotVector fine_u = *with_knots(u, random_new_knots(random, u, 11));
    const KnotVector fine_v = *with_knots(v, random_new_knots(random, v, 8));
    const BSplineSurface<3> surface = random_surface<3>(random, u, v);
    const auto by = [&](CompactRows (*matrix)(const KnotVector&, const KnotVector&)) {
      return transform_v(transform_u(surface, matrix(u, fine_u), fine_u), matrix(v, fine_v), fine_v)
          .control_points();
    };
    const Eigen::Matrix3Xd ours = refine(surface, fine_u, fine_v).control_points();
    for (const auto matrix : {refinement_matrix, refinement_matrix_oslo, refinement_matrix_boehm}) {
      EXPECT_LT((by(matrix) - ours).cwiseAbs().maxCoeff(), 64 * kEpsilon);
    }
  }
}

TEST(WithKnots, RefusesAValueOutsideTheDomainAndAMultiplicityAboveTheOrder) {
  const KnotVector knots = KnotVector::clamped(2, {0, 1, 2});
  const auto outside = with_knots(knots, {0.5, 2.5});
  ASSERT_FALSE(outside);
  EXPECT_NE(outside.error().message().find("2.5"), std::string::npos);
  EXPECT_TRUE(with_knots(knots, {1, 1}));
  EXPECT_FALSE(with_knots(knots, {1, 1, 1}));
  EXPECT_FALSE(with_knots(knots, {0}));
}

TEST(Split, PartsMeetAndAreTheWhole) {
  Random random(5);
  for (int round = 0; round < 300; ++round) {
    const KnotVector knots = random_knots(random, 1 + random.below(7));
    const BSplineCurve<3> curve = random_curve<3>(random, knots);
    const double at = random.below(3) == 0 && knots.breakpoints().size() > 2
                          ? knots.breakpoints()[1]
                          : random.uniform(knots.first(), knots.last());
    const auto [left, right] = split(curve, at);
    EXPECT_EQ(left.knots().last(), at);
    EXPECT_EQ(right.knots().first(), at);
    for (int k = 0; k < 10; ++k) {
      const double t = random.uniform(knots.first(), knots.last());
      const BSplineCurve<3>& part = t < at ? left : right;
      EXPECT_LT((part.at(t) - curve.at(t)).norm(), 1e-14);
    }
  }
}

TEST(Split, SurfaceSidesOfTheTwoPartsAreTheSameCurve) {
  Random random(6);
  const KnotVector u = KnotVector::clamped(5, {0, 0.4, 1}, 2);
  const KnotVector v = KnotVector::clamped(3, {0, 0.2, 0.7, 1});
  const BSplineSurface<3> surface = random_surface<3>(random, u, v);
  const auto [low, high] = split_u(surface, 0.55);
  const auto [left, right] = split_v(surface, 0.7);
  for (const double s : {0.0, 0.1, 0.55, 0.9, 1.0}) {
    EXPECT_LT((low.at(0.55, s) - high.at(0.55, s)).norm(), 1e-15);
    EXPECT_LT((left.at(s, 0.7) - surface.at(s, 0.7)).norm(), 1e-14);
    EXPECT_LT((right.at(s, 0.8) - surface.at(s, 0.8)).norm(), 1e-14);
    EXPECT_LT((low.at(0.3, s) - surface.at(0.3, s)).norm(), 1e-14);
  }
}

TEST(BezierPieces, AreClampedSingleSpansThatAgreeWithTheSpline) {
  Random random(7);
  int pieces_seen = 0;
  for (int round = 0; round < 100; ++round) {
    const KnotVector u = random_knots(random, 1 + random.below(5), 9);
    const KnotVector v = random_knots(random, 1 + random.below(5));
    const BSplineSurface<2> surface = random_surface<2>(random, u, v);
    const auto pieces = bezier_pieces(surface);
    EXPECT_EQ(pieces.size(), (u.breakpoints().size() - 1) * (v.breakpoints().size() - 1));
    for (const BSplineSurface<2>& piece : pieces) {
      EXPECT_EQ(piece.u_count(), u.order());
      EXPECT_EQ(piece.v_count(), v.order());
      const double s = 0.5 * (piece.u().first() + piece.u().last());
      const double t = 0.5 * (piece.v().first() + piece.v().last());
      EXPECT_LT((piece.at(s, t) - surface.at(s, t)).norm(), 1e-14);
      ++pieces_seen;
    }
  }
  EXPECT_GT(pieces_seen, 100);
}

}  // namespace
}  // namespace angiospline
