// B-spline basis functions and their derivatives at one parameter.
#pragma once

#include <array>

#include <Eigen/Core>

#include "kernel/spline/knot_vector.h"

namespace angiospline {

// The order() basis functions that do not vanish on a span, and their derivatives. The matrix lives
// inside the object: no allocation.
struct BasisValues {
  static constexpr int kMax = KnotVector::kMaxDegree + 1;
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor, kMax, kMax>;

  int first;      // index of the first basis function: span - degree
  Matrix values;  // row d: d-th derivatives; column j: basis function first + j
};

// Derivatives 0 .. derivatives at t; one-sided from the right, from the left at the end of the
// domain. Outside the domain the end polynomials are continued. Rows above the degree are zero.
// Requires derivatives <= kMaxDegree. O(degree^2). No allocation.
// Reference: The NURBS Book, algorithms A2.2 and A2.3 (de Boor's recurrence).
BasisValues basis_at(const KnotVector& knots, double t, int derivatives = 0, int span_hint = -1);

// The same on a span the caller knows; row d starts at out[d * order]. Requires a span of positive
// length and room for (derivatives + 1) * order doubles. Fixed-degree code up to degree 7.
void basis_on_span(const KnotVector& knots, int span, double t, int derivatives, double* out);

// The values alone, at many parameters span by span: what is divided by on a span is divided by
// once. Agrees with the above to a few ulps.
class SpanBasis {
 public:
  // Keeps a reference to `knots`.
  explicit SpanBasis(const KnotVector& knots) : knots_(knots) {}

  // The order() values at t. Requires a span of positive length.
  void values(int span, double t, double* out);

 private:
  const KnotVector& knots_;
  int span_ = -1;
  std::array<double, KnotVector::kMaxDegree*(KnotVector::kMaxDegree + 1) / 2> reciprocals_;
};

}  // namespace angiospline
