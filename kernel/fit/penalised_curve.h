// Least squares in a spline space, with held end control points and a bending penalty.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "kernel/spline/knot_vector.h"

namespace angiospline {

// What fit_spline minimises: sum_i weight_i |c(t_i) - value_i|^2 + integral bending(t) |c''(t)|^2
// dt. One row of `values` is one sample in any dimension; every column is fitted by the same linear
// operator, so a linear relation between columns of the data is a relation between the splines.
struct SplineFitProblem {
  std::vector<double> parameters;  // in the knots' domain, not decreasing
  Eigen::MatrixXd values;          // one row for each parameter
  std::vector<double> weights;     // one for each parameter; empty: all 1
  std::vector<double> bending;     // one for each breakpoint interval; empty: none
  Eigen::MatrixXd first;           // control points held at the beginning, one a row; may be empty
  Eigen::MatrixXd last;            // held at the end: the last row is the last control point
};

// The control points, one a row. Requires held rows that do not overlap, and samples (or bending)
// enough to determine the free ones: a span without samples gets a ridge of 1e-12 of the largest
// diagonal and so stays near zero. O((samples + control points) * degree^2).
// Reference: de Boor, A Practical Guide to Splines, chapter XIV; banded Cholesky.
Eigen::MatrixXd fit_spline(const KnotVector& knots, const SplineFitProblem& problem);

}  // namespace angiospline
