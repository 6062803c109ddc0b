// Products of spline curves, exactly.
#pragma once

#include "kernel/spline/curve.h"

namespace angiospline {

// a(t) b(t) as a spline over product_knots: the sum of the degrees, the least of the continuities.
// Each coefficient is the mean, over all ways to deal its knots out to the factors, of the product
// of their blossoms; equal knots are dealt together, so the cost of a coefficient is the number of
// distinct deals, not binomial(p + q, p). No linear system, no division by small numbers.
// Requires equal domains (give the factors one by over()) and p + q <= kMaxDegree.
// Reference: Morken, Some identities for products and degree raising of splines, Constr. Approx. 7
// (1991); thesis 3.5 and reference [65].
BSplineCurve<1> product(const BSplineCurve<1>& a, const BSplineCurve<1>& b);
template <int D>  // 2 to 4
BSplineCurve<D> product(const BSplineCurve<1>& a, const BSplineCurve<D>& b);

// a(t) . b(t), and a(t) x b(t). D is 1 to 4.
template <int D>
BSplineCurve<1> dot_product(const BSplineCurve<D>& a, const BSplineCurve<D>& b);
BSplineCurve<3> cross_product(const BSplineCurve<3>& a, const BSplineCurve<3>& b);

}  // namespace angiospline
