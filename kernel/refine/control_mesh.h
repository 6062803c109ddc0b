// Refinement until the control mesh itself may stand for the curve or surface (thesis 3.1).
#pragma once

#include "base/result.h"
#include "kernel/spline/curve.h"
#include "kernel/spline/surface.h"

namespace angiospline {

// A bound on the distance between a spline and its control polygon: no point c(t) is farther than
// this from the point of the polygon through (greville(i), control point i) at the same t.
// Linear in control points.
//
// Proof. Let l be the polygon as a function of t. On a span of knots a and of the polygon, c - l is
// sum_i N_i(t) (c_i - l(t)), for N_i sum to 1. l is linear between neighbouring Greville points, so
// with L the line that l is there, sum_i N_i(t) L(g_i) = L(t) (the B-spline basis reproduces lines
// at the Greville points) gives c(t) - l(t) = sum_i N_i(t) (c_i - L(g_i)), the sum over the order()
// functions alive at t. |c_i - L(g_i)| is how far control point i lies from the line prolonged, and
// is at most the sum of the changes of slope between them, each times its distance to g_i. The
// bound takes the largest over i of that for every polygon leg and span that meet. Halving every
// span quarters it (Cohen & Schumaker, Rates of convergence of control polygons, CAGD 2, 1985;
// Lyche 1987).
template <int D>
double control_polygon_distance(const BSplineCurve<D>& curve);

// The same for a surface and its bilinear control mesh over the Greville grid: the largest bound
// over the rows plus the largest over the columns of the net, as S - mesh splits into a step along
// u of curves whose control points are columns, and a step along v between control polygons.
template <int D>
double control_mesh_distance(const BSplineSurface<D>& surface);

struct MeshOptions {
  double tolerance = 0.0;  // in the unit of the control points
  int most_control_points = 1000000;
};

template <int D>
struct RefinedCurve {
  BSplineCurve<D> curve;
  double distance;  // the bound, <= tolerance
};

template <int D>
struct RefinedSurface {
  BSplineSurface<D> surface;
  double distance;
};

// The same curve or surface with knots inserted where and as often as the bound needs it: spans
// whose part of the bound is above the tolerance are cut in as many equal pieces as the quadratic
// convergence asks for, until none is. For surfaces the tolerance is shared between the directions
// so that few control points are needed. Where cutting every span of a direction alike needs fewer,
// that is done instead: never more than uniform refinement. Errors: tolerance not positive; a jump
// inside (multiplicity above the degree), over which no polygon converges; more control points
// needed than allowed. What is closed stays closed. D is 1 to 4 (surfaces 2 to 4).
template <int D>
Result<RefinedCurve<D>> refine_to_tolerance(const BSplineCurve<D>& curve,
                                            const MeshOptions& options);
template <int D>
Result<RefinedSurface<D>> refine_to_tolerance(const BSplineSurface<D>& surface,
                                              const MeshOptions& options);

// The same for rational ones, held homogeneous, and their projected control polygon or mesh (lines
// project to lines): every point of either is within `distance` of a point of the other. Requires
// positive weights. Curves: D 1 to 3. Surfaces: D 2 or 3.
template <int D>
Result<RefinedCurve<D + 1>> refine_to_tolerance_rational(const BSplineCurve<D + 1>& curve,
                                                         MeshOptions options);
template <int D>
Result<RefinedSurface<D + 1>> refine_to_tolerance_rational(const BSplineSurface<D + 1>& surface,
                                                           MeshOptions options);

}  // namespace angiospline
