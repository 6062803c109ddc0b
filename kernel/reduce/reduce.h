// Data reduction: as few knots as a tolerance allows.
#pragma once

#include <vector>

#include "base/result.h"
#include "kernel/spline/curve.h"
#include "kernel/spline/knot_algebra.h"
#include "kernel/spline/surface.h"

namespace angiospline {

struct ReductionOptions {
  double tolerance = 0.0;  // largest Euclidean distance at equal parameters, in the curve's unit
  int held_first = 1;      // derivatives 0 .. held - 1 at the first end are kept exactly; 0: none
  int held_last = 1;
  std::vector<Knot> kept;  // interior knots that stay, with at least this multiplicity

  // How hard to try once a first answer stands: rounds of moving knots to where the error is and of
  // reweighting towards the uniform norm. 0 gives the first answer.
  int polish = 2;
};

template <int D>
struct ReducedCurve {
  BSplineCurve<D> curve;
  double error_bound;  // no point is farther from the original at the same parameter; <= tolerance
  int trials;          // least-squares problems solved
};

// A curve with fewer knots than `curve`, within the tolerance of it. Linear in control points for
// each trial, and about 10 to 25 trials. A closed curve (is_periodic) stays closed, with the
// continuity of its seam; other knots outside the domain all stay. Errors: tolerance not positive,
// more held conditions than the degree has, held floating ends (a closed curve has none to hold).
//
// Method: Lyche & Morken, A data-reduction strategy for splines (IMA J. Numer. Anal. 8, 1988), and
// differs from it: (1) a knot's weight is the exact distance, in the discrete norm, to the splines
// without it, as there; but its (p + 1)-th root is read as the share of knots its place deserves,
// and subsets are drawn at equal shares of their sum, so that smooth curves get equally spaced
// errors from the start; ranks (least share first, shares of removed knots going to their
// neighbours) are tried beside it, and find knots that carry nothing; (2) the number of knots is
// found by the order of convergence instead of halving; (3) then knots move to where the error is,
// and the weights of the least squares follow the error (Lawson), as long as fewer knots do. Error:
// sampled while searching, bounded at the end by the refined control polygon of the difference.
template <int D>
Result<ReducedCurve<D>> reduce(const BSplineCurve<D>& curve, const ReductionOptions& options);

// A curve of the given degree within `tolerance` of every point at its parameter, with few control
// points: interpolation over averaged knots, then reduction (the ends are met exactly).
// Errors: fewer points than the order, parameters that do not increase, those of reduce.
// Reference for the knots: The NURBS Book, (9.8).
template <int D>
Result<ReducedCurve<D>> fit_to_tolerance(int degree, const std::vector<double>& parameters,
                                         const Eigen::Matrix<double, D, Eigen::Dynamic>& points,
                                         double tolerance);

struct SurfaceReductionOptions {
  double tolerance = 0.0;
  int held_u0 = 1, held_u1 = 1, held_v0 = 1, held_v1 = 1;  // cross derivatives held at the sides
  std::vector<Knot> kept_u, kept_v;
  int polish = 2;
};

enum class ReductionOrder { kUFirst, kVFirst };

template <int D>
struct ReducedSurface {
  BSplineSurface<D> surface;
  double error_bound;
  int trials;
  ReductionOrder order;  // the one that gave fewer control points (kUFirst when equal)
};

// The same for tensor-product surfaces: one direction with a share of the tolerance, then the other
// with what is left; both orders are tried and the better kept. A closed direction (is_periodic_u,
// v) stays closed, with the continuity of its seam, and has no sides to hold.
template <int D>
Result<ReducedSurface<D>> reduce(const BSplineSurface<D>& surface,
                                 const SurfaceReductionOptions& options);

// The same for rational curves and surfaces, held homogeneous: the tolerance and the bound are on
// the projected points, what is held are projected derivatives. Requires positive weights; the
// function of the weights stays positive, single control weights need not. Curves: D 1 to 3.
// Surfaces: 2, 3.
template <int D>
Result<ReducedCurve<D + 1>> reduce_rational(const BSplineCurve<D + 1>& curve,
                                            ReductionOptions options);
template <int D>
Result<ReducedSurface<D + 1>> reduce_rational(const BSplineSurface<D + 1>& surface,
                                              SurfaceReductionOptions options);

// For each interior knot (index degree + 1 .. control_point_count - 1) the distance, in the largest
// coefficient, from the spline to those without this copy of the knot (of a multiple one, the
// lightest copy first, each weighed with the ones before it gone). `stride` numbers a control
// point in groups of `group` that are measured in the Euclidean norm.
std::vector<double> knot_weights(const KnotVector& knots, const double* points, int stride,
                                 int group);

}  // namespace angiospline
