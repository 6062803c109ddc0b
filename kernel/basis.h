// B-spline basis functions and their derivatives at one parameter.
#pragma once

#include <Eigen/Core>

#include "kernel/knot_vector.h"

namespace angiospline {

// The order() basis functions that do not vanish on a span, and their derivatives.
struct BasisValues {
  int first;                // index of the first basis function: span - degree
  Eigen::MatrixXd values;   // row d: d-th derivatives; column j: basis function first + j
};

// Derivatives 0 .. derivatives at t; one-sided from the right, from the left at the end of the
// domain. Outside the domain the end polynomials are continued. O(degree^2).
// Reference: The NURBS Book, algorithms A2.2 and A2.3 (de Boor's recurrence).
BasisValues basis_at(const KnotVector& knots, double t, int derivatives = 0, int span_hint = -1);

}  // namespace angiospline
