// Knot insertion and refinement: one sparse matrix, three independent ways to it.
#pragma once

#include <vector>

#include "base/result.h"
#include "kernel/numerics/compact_rows.h"
#include "kernel/spline/curve.h"
#include "kernel/spline/knot_vector.h"
#include "kernel/spline/surface.h"

namespace angiospline {

// `knots` with `added` (any order, values may repeat) merged in.
// Errors: a value outside the domain, or a multiplicity above the order; each names the value.
Result<KnotVector> with_knots(const KnotVector& knots, std::vector<double> added);

// Whether every knot of `coarse` is in `fine` with at least its multiplicity, over the same domain
// and with the same degree: the condition under which the matrices below exist.
bool is_refinement(const KnotVector& coarse, const KnotVector& fine);

// The matrix A with fine control points = A * coarse control points: row i has at most order()
// entries, none negative; rows of functions that reach into the domain sum to 1. Requires
// is_refinement(coarse, fine). The ends may be clamped or floating.
//
// refinement_matrix: improved Oslo. Row i is a discrete B-spline of degree nu, the number of NEW
//   knots among fine(i+1) .. fine(i+p), so untouched rows cost nothing; O(rows * (1 + nu^2)).
//   Lyche & Morken, Making the Oslo algorithm more efficient, SIAM J. Numer. Anal. 23 (1986).
// refinement_matrix_oslo: every row a discrete B-spline of full degree; O(rows * p^2).
//   Cohen, Lyche & Riesenfeld, Discrete B-splines and subdivision techniques, CGIP 14 (1980).
// refinement_matrix_boehm: one knot at a time, the bidiagonal factors multiplied up.
//   Boehm, Inserting new knots into B-spline curves, CAD 12 (1980).
// The three agree to a few ulps; the last two are there to check the first.
CompactRows refinement_matrix(const KnotVector& coarse, const KnotVector& fine);
CompactRows refinement_matrix_oslo(const KnotVector& coarse, const KnotVector& fine);
CompactRows refinement_matrix_boehm(const KnotVector& coarse, const KnotVector& fine);

// out += factor * A * blocks with A = refinement_matrix(coarse, fine), which is not built: control
// points are blocks of `stride` doubles. Requires is_refinement(coarse, fine).
void add_refined(double factor, const KnotVector& coarse, const KnotVector& fine,
                 const double* blocks, int stride, double* out);

// The same curve or surface over finer knots. Requires is_refinement in each direction.
// D is 1 to 4. Linear in the number of fine control points.
template <int D>
BSplineCurve<D> refine(const BSplineCurve<D>& curve, KnotVector fine);
template <int D>
BSplineSurface<D> refine(const BSplineSurface<D>& surface, const KnotVector& fine_u,
                         const KnotVector& fine_v);

// The same curve over any knots of its degree and domain that have every interior knot at least as
// often; knots beyond the domain are free. So it clamps, unclamps and makes periodic as well as it
// refines. Each new control point is one blossom value; O(control points * degree^2).
template <int D>
BSplineCurve<D> rewrite(const BSplineCurve<D>& curve, const KnotVector& knots);
CompactRows rewriting_matrix(const KnotVector& from, const KnotVector& to);

// Net transforms: A along u (v fixed), and along v; the result has the knots given.
template <int D>
BSplineSurface<D> transform_u(const BSplineSurface<D>& surface, const CompactRows& A, KnotVector u);
template <int D>
BSplineSurface<D> transform_v(const BSplineSurface<D>& surface, const CompactRows& A, KnotVector v);

// Inserts knots: with_knots, then refine; errors as there.
template <int D>
Result<BSplineCurve<D>> insert_knots(const BSplineCurve<D>& curve, std::vector<double> added);

}  // namespace angiospline
