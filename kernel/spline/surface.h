// Tensor-product B-spline surfaces in 2 to 4 dimensions.
#pragma once

#include <algorithm>
#include <utility>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "base/contract.h"
#include "kernel/spline/basis.h"
#include "kernel/spline/knot_vector.h"

namespace angiospline {

// Spans of the knot vectors in u and v; -1: none known.
struct SpanHint {
  int u = -1;
  int v = -1;
};

// Knot vectors in u and v and a net of control points. Control point (i, j), i along u and j along
// v, is column i * v_count + j. Rational surfaces are held homogeneous, one dimension higher.
template <int D>
class BSplineSurface {
 public:
  using Point = Eigen::Matrix<double, D, 1>;
  using ControlPoints = Eigen::Matrix<double, D, Eigen::Dynamic>;

  // Requires u_count * v_count columns.
  BSplineSurface(KnotVector u, KnotVector v, ControlPoints control_points)
      : u_(std::move(u)), v_(std::move(v)), control_points_(std::move(control_points)) {
    EXPECTS(control_points_.cols() == static_cast<Eigen::Index>(u_count()) * v_count());
  }

  const KnotVector& u() const { return u_; }
  const KnotVector& v() const { return v_; }
  int u_count() const { return u_.control_point_count(); }
  int v_count() const { return v_.control_point_count(); }
  const ControlPoints& control_points() const { return control_points_; }
  Eigen::Index index(int i, int j) const { return static_cast<Eigen::Index>(i) * v_count() + j; }
  Point control_point(int i, int j) const { return control_points_.col(index(i, j)); }

  // The mixed derivative d^(a+b) S / du^a dv^b at (u, v), of any order; a = b = 0: the point. The
  // caller may hold a hint, the spans of the last call or any others: right ones save the search,
  // and the spans found are written back. The result does not depend on it. No allocation.
  Point at(double u, double v, int a = 0, int b = 0) const {
    SpanHint hint;
    return at(u, v, hint, a, b);
  }
  Point at(double u, double v, SpanHint& hint, int a = 0, int b = 0) const {
    const BasisValues bu = basis_at(u_, u, std::min(a, u_.degree()), hint.u);
    const BasisValues bv = basis_at(v_, v, std::min(b, v_.degree()), hint.v);
    hint = {bu.first + u_.degree(), bv.first + v_.degree()};
    Point sum = Point::Zero();
    if (a > u_.degree() || b > v_.degree()) return sum;
    for (int i = 0; i < u_.order(); ++i) {
      const auto row = control_points_.middleCols(index(bu.first + i, bv.first), v_.order());
      sum += bu.values(a, i) * (row * bv.values.row(b).transpose());
    }
    return sum;
  }

 private:
  KnotVector u_;
  KnotVector v_;
  ControlPoints control_points_;
};

// Su x Sv at (u, v), not normalised; zero where the surface is singular.
inline Eigen::Vector3d normal_vector(const BSplineSurface<3>& surface, double u, double v) {
  return surface.at(u, v, 1, 0).cross(surface.at(u, v, 0, 1));
}

}  // namespace angiospline
