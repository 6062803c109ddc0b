// Interpolation and least squares on a given knot vector; everything is banded and linear in size.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "base/result.h"
#include "kernel/numerics/compact_rows.h"
#include "kernel/spline/curve.h"
#include "kernel/spline/surface.h"

namespace angiospline {

// Row r: the basis functions (or their `derivative`-th derivatives) at parameters[r].
CompactRows collocation_matrix(const KnotVector& knots, const std::vector<double>& parameters,
                               int derivative = 0);

// The values into the memory of an earlier matrix.
void collocate(const KnotVector& knots, const std::vector<double>& parameters, CompactRows& into);

// The same for the derivatives 0 .. derivatives, each basis computed once.
std::vector<CompactRows> collocation_matrices(const KnotVector& knots,
                                              const std::vector<double>& parameters,
                                              int derivatives);

// Schoenberg-Whitney: parameters[i] must lie inside the support of basis function i (at a clamped
// end also on it) for interpolation to have exactly one solution. Returns the error that names the
// first violated pair, or nothing. Requires increasing parameters, one for each control point.
std::optional<Error> schoenberg_whitney_violation(const KnotVector& knots,
                                                  const std::vector<double>& parameters);

// The curve through points.col(i) at parameters[i]. Errors: counts that differ, parameters that do
// not increase or lie outside the domain, a violated Schoenberg-Whitney pair.
template <int D>
Result<BSplineCurve<D>> interpolate(const KnotVector& knots, const std::vector<double>& parameters,
                                    const Eigen::Matrix<double, D, Eigen::Dynamic>& points);

// The spline that agrees with `f` at the Greville points: reproduces splines over these knots.
// Requires continuity of the basis (no interior knot of multiplicity above the degree).
template <int D>
BSplineCurve<D> interpolate_at_greville(const KnotVector& knots,
                                        const Eigen::Matrix<double, D, Eigen::Dynamic>& points);
template <int D>
BSplineSurface<D> interpolate_at_greville(const KnotVector& u, const KnotVector& v,
                                          const Eigen::Matrix<double, D, Eigen::Dynamic>& points);

// What the least-squares curve must meet exactly at an end of clamped knots. Needs a position for a
// derivative to be held.
template <int D>
struct EndCondition {
  std::optional<Eigen::Matrix<double, D, 1>> position;
  std::optional<Eigen::Matrix<double, D, 1>> derivative;  // with respect to the parameter
};

template <int D>
struct CurveFitOptions {
  EndCondition<D> first;
  EndCondition<D> last;
  std::vector<double> weights;  // one for each point; empty: all 1
  double roughness = 0.0;       // weight of the integral of |c^(roughness_derivative)|^2
  int roughness_derivative = 3;
};

template <int D>
struct CurveFit {
  BSplineCurve<D> curve;
  double largest_residual;  // Euclidean, over the points, at their parameters
  double rms_residual;
};

// The least-squares curve over `knots`. Parameters in the domain, in any order; several points may
// share one. Errors: counts that differ, a parameter outside the domain, a span without enough
// points (the named basis function is not determined; cannot happen with roughness > 0), a
// derivative held without its position, held ends that overlap. Normal equations by banded
// Cholesky, then one step of refinement on the residual (corrected seminormal equations: Bjorck,
// Linear Algebra Appl. 88/89, 1987).
template <int D>
Result<CurveFit<D>> fit_curve(const KnotVector& knots, const std::vector<double>& parameters,
                              const Eigen::Matrix<double, D, Eigen::Dynamic>& points,
                              const CurveFitOptions<D>& options = {});

// The least-squares control points over `knots`, one row each, for any number of coordinates:
// values have one row for each parameter. Errors as fit_curve.
Result<Eigen::MatrixXd> least_squares_rows(const KnotVector& knots,
                                           const std::vector<double>& parameters,
                                           const Eigen::MatrixXd& values);

// The least-squares surface on a grid of points: point (i, j) at (us[i], vs[j]) is column
// i * vs.size() + j. Errors as for curves, saying which direction. One curve system for each
// direction.
template <int D>
Result<BSplineSurface<D>> fit_surface(const KnotVector& u, const KnotVector& v,
                                      const std::vector<double>& us, const std::vector<double>& vs,
                                      const Eigen::Matrix<double, D, Eigen::Dynamic>& points);

// The Gram matrix of the k-th derivatives of the basis over the domain, exact (Gauss-Legendre):
// entry (i, j) is stored in row i at column j for |i - j| <= degree. Row width 2 degree + 1, or
// columns() where that is smaller.
CompactRows gram_matrix(const KnotVector& knots, int derivative);

}  // namespace angiospline
