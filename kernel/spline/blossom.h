// The polar form of one polynomial piece of a spline.
#pragma once

#include "kernel/spline/knot_vector.h"

namespace angiospline {

// Writes the degree() + 1 factors with which the control points span - degree .. span enter the
// blossom f[args[0], ..., args[degree - 1]] of the piece on `span`. All args equal t: the basis
// functions at t. Control point i itself is f[knot(i + 1), ..., knot(i + degree)] of any piece
// inside the support of basis function i. Requires a span of positive length. O(degree^2).
// Reference: Ramshaw, Blossoms are polar forms, CAGD 6 (1989).
void blossom_row(const KnotVector& knots, int span, const double* args, double* out);

// For each basis function of `wanted`, a span of positive length of `knots` inside its support.
// Requires the same domain and every knot of `knots` inside it also in `wanted`, so that the span
// is inside one piece of both.
int span_inside_support(const KnotVector& knots, const KnotVector& wanted, int function);

}  // namespace angiospline
