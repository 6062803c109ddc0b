// Knot vectors made from knot vectors: for products, elevated degrees, common spaces, other
// domains.
#pragma once

#include <vector>

#include "kernel/spline/knot_vector.h"

namespace angiospline {

// A distinct knot and how often it stands in a knot vector.
struct Knot {
  double value;
  int multiplicity;

  friend bool operator==(const Knot& a, const Knot& b) = default;
};

// The distinct knots, those outside the domain included; and back (see KnotVector::make for
// errors).
std::vector<Knot> distinct_knots(const KnotVector& knots);
Result<KnotVector> from_distinct(int degree, const std::vector<Knot>& knots);

// Knots of the product of two splines over the same domain: degree p + q, and at each value
// multiplicity max(m_a + q, m_b + p) over those that have it (the general form of thesis 3.6, 3.7:
// m = n - (n_c - m_c) with the factor c of least continuity). Clamped where both are clamped; at a
// floating end as many outer knots as the degree needs. Requires equal domains and
// p + q <= kMaxDegree.
KnotVector product_knots(const KnotVector& a, const KnotVector& b);

// Knots of the same splines at degree p + by: every multiplicity grows by `by`.
KnotVector elevated_knots(const KnotVector& knots, int by = 1);

// The coarsest common refinement: at each value the higher multiplicity. Requires equal degree and
// domain, and clamped ends or equal knots beyond floating ones.
KnotVector merged_knots(const KnotVector& a, const KnotVector& b);

// The affine image over [first, last]; the ends are met exactly. Requires first < last.
KnotVector with_domain(const KnotVector& knots, double first, double last);

// The image under t -> first() + last() - t.
KnotVector reversed(const KnotVector& knots);

// Values of `knots` that lie within `tolerance` of a knot of `model` become that knot: the one
// place where knots are compared with a tolerance; everywhere else comparison is exact. Requires a
// tolerance below half the shortest span of either.
KnotVector snapped(const KnotVector& knots, const KnotVector& model, double tolerance);

}  // namespace angiospline
