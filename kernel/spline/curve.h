// B-spline curves in 1 to 4 dimensions.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "base/contract.h"
#include "kernel/spline/basis.h"
#include "kernel/spline/knot_vector.h"

namespace angiospline {

// A knot vector and one control point (a column) for each basis function.
// Rational curves are held homogeneous, one dimension higher.
template <int D>
class BSplineCurve {
 public:
  using Point = Eigen::Matrix<double, D, 1>;
  using ControlPoints = Eigen::Matrix<double, D, Eigen::Dynamic>;

  // Requires one column for each basis function.
  BSplineCurve(KnotVector knots, ControlPoints control_points)
      : knots_(std::move(knots)), control_points_(std::move(control_points)) {
    EXPECTS(control_points_.cols() == knots_.control_point_count());
  }

  const KnotVector& knots() const { return knots_; }
  const ControlPoints& control_points() const { return control_points_; }

  // The k-th derivative at t (k = 0: the point), of any order. No allocation. O(degree^2).
  Point at(double t, int k = 0, int span_hint = -1) const {
    if (k > knots_.degree()) return Point::Zero();
    const BasisValues b = basis_at(knots_, t, k, span_hint);
    return control_points_.middleCols(b.first, knots_.order()) * b.values.row(k).transpose();
  }

 private:
  KnotVector knots_;
  ControlPoints control_points_;
};

}  // namespace angiospline
