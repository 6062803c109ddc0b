// Binomials, blossoms, and the two codes for basis functions against each other.
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "kernel/spline/basis.h"
#include "kernel/spline/binomial.h"
#include "kernel/spline/blossom.h"
#include "tests/shapes/random_splines.h"

namespace angiospline {
namespace {

TEST(Binomial, FollowsPascalSymmetryAndTheSumOfItsRow) {
  for (int n = 0; n <= 57; ++n) {
    double sum = 0;
    for (int k = 0; k <= n; ++k) {
      EXPECT_EQ(binomial(n, k), binomial(n, n - k));
      sum += binomial(n, k);
    }
    EXPECT_NEAR(sum, std::ldexp(1.0, n), std::ldexp(1.0, n - 50));
    EXPECT_EQ(binomial(n, -1), 0);
    EXPECT_EQ(binomial(n, n + 1), 0);
  }
  EXPECT_EQ(binomial(5, 2), 10);
  EXPECT_EQ(binomial(56, 28), 7648690600760440.0);
}

TEST(SpanBasis, AgreesWithTheGeneralCodeToAFewUlps) {
  Random random(1);
  for (int round = 0; round < 200; ++round) {
    const KnotVector knots = random_knots(random, random.below(9));
    SpanBasis basis(knots);
    std::vector<double> values(static_cast<std::size_t>(knots.order()));
    for (int k = 0; k < 5; ++k) {
      const double t = random_parameter(random, knots);
      const int span = knots.span(t);
      basis.values(span, t, values.data());
      const BasisValues general = basis_at(knots, t);
      for (int j = 0; j < knots.order(); ++j)
        EXPECT_NEAR(values[static_cast<std::size_t>(j)], general.values(0, j), 1e-13);
    }
  }
}

TEST(Basis, DerivativesAgreeWithFiniteDifferences) {
  Random random(2);
  for (int round = 0; round < 100; ++round) {
    const KnotVector knots = KnotVector::clamped(2 + random.below(6), {0, 0.5, 1.25, 2});
    const double t = random.uniform(0.55, 1.2), h = 1e-5;
    const BasisValues at = basis_at(knots, t, 2);
    const BasisValues before = basis_at(knots, t - h, 1), after = basis_at(knots, t + h, 1);
    for (int d = 0; d < 2; ++d)
      EXPECT_LT(((after.values.row(d) - before.values.row(d)) / (2 * h) - at.values.row(d + 1))
                    .cwiseAbs()
                    .maxCoeff(),
                1e-5);
  }
}

TEST(Blossom, OnTheDiagonalIsTheBasisAndOnKnotsAUnitRow) {
  Random random(3);
  for (int round = 0; round < 200; ++round) {
    const int p = 1 + random.below(7);
    const KnotVector knots = KnotVector::clamped(p, {0, 1, 2.5, 3, 4}, 1 + random.below(p));
    const double t = random_parameter(random, knots);
    const int span = knots.span(t);
    std::vector<double> args(static_cast<std::size_t>(p), t);
    std::vector<double> row(static_cast<std::size_t>(p) + 1);
    blossom_row(knots, span, args.data(), row.data());
    const BasisValues basis = basis_at(knots, t);
    for (int j = 0; j <= p; ++j)
      EXPECT_NEAR(row[static_cast<std::size_t>(j)], basis.values(0, j), 1e-12);

    // Control point i is f[knot(i + 1), ..., knot(i + p)].
    for (int i = span - p; i <= span; ++i) {
      blossom_row(knots, span, knots.knots().data() + i + 1, row.data());
      for (int j = 0; j <= p; ++j)
        EXPECT_NEAR(row[static_cast<std::size_t>(j)], j == i - span + p ? 1 : 0, 1e-9);
    }
  }
}

TEST(Blossom, IsSymmetricAndAffineInEachArgument) {
  Random random(4);
  const KnotVector knots = KnotVector::clamped(3, {0, 1, 2, 4});
  std::vector<double> a(4), b(4), middle(4), turned(4);
  for (int round = 0; round < 50; ++round) {
    const double x = random.uniform(0, 4), y = random.uniform(0, 4), z = random.uniform(0, 4),
                 w = random.uniform(0, 4);
    const std::vector<double> first{x, y, z}, second{w, y, z}, mean{0.25 * x + 0.75 * w, y, z},
        order{z, x, y};
    blossom_row(knots, 4, first.data(), a.data());
    blossom_row(knots, 4, second.data(), b.data());
    blossom_row(knots, 4, mean.data(), middle.data());
    blossom_row(knots, 4, order.data(), turned.data());
    for (std::size_t j = 0; j < 4; ++j) {
      EXPECT_NEAR(middle[j], 0.25 * a[j] + 0.75 * b[j], 1e-12 * (1 + std::abs(a[j])));
      EXPECT_NEAR(turned[j], a[j], 1e-12 * (1 + std::abs(a[j])));
    }
  }
}

TEST(Blossom, ASpanInsideASupportLiesInItAndHasALength) {
  Random random(5);
  for (int round = 0; round < 100; ++round) {
    const KnotVector knots = random_knots(random, 1 + random.below(6), 0, false);
    for (int i = 0; i < knots.control_point_count(); ++i) {
      const int span = span_inside_support(knots, knots, i);
      EXPECT_LT(knots[span], knots[span + 1]);
      EXPECT_GE(span, i);
      EXPECT_LE(span, i + knots.degree());
    }
  }
}

}  // namespace
}  // namespace angiospline
