// Squared distances from a point to pieces of curves and surfaces, as Bernstein polynomials. Not
// part of the installed interface.
#pragma once

#include <array>
#include <utility>

#include <Eigen/Core>

#include "kernel/spline/curve.h"
#include "kernel/spline/surface.h"

namespace angiospline {

// Over a box of parameters the squared distance is F / W: F the squared length of P - w q in
// Bernstein form, W that of w (all ones where nothing is rational). A curve is a surface of degree
// 0 along v.
struct BernsteinBox {
  using Coefficients = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  Coefficients F;
  Coefficients W;  // empty: all ones
  std::array<double, 2> low;
  std::array<double, 2> high;

  bool holds(double u, double v) const {
    return low[0] <= u && u <= high[0] && low[1] <= v && v <= high[1];
  }

  // Nothing in the box is nearer than the root of this (may be negative: then nothing is known).
  double lower_bound() const;

  // Whether F - squared * W bends upwards everywhere in the box, or not at all: a point of the box
  // where it is zero and its slope vanishes (at the rim of the domain: does not point inwards) is
  // then the nearest of the box.
  bool is_convex(double squared) const;

  // Where the control polygon of F / W is lowest.
  std::array<double, 2> lowest() const;

  // Both halves, across the direction in which F bends more.
  std::pair<BernsteinBox, BernsteinBox> halves() const;
};

// The box of one span (of positive length); of homogeneous control points too, whose last
// coordinate is the weight: D is the dimension of the target, H that of the control points, D or
// D + 1.
template <int D, int H>
BernsteinBox bernstein_box(const BSplineCurve<H>& curve, int span,
                           const Eigen::Matrix<double, D, 1>& target);
template <int D, int H>
BernsteinBox bernstein_box(const BSplineSurface<H>& surface, int u_span, int v_span,
                           const Eigen::Matrix<double, D, 1>& target);

}  // namespace angiospline
