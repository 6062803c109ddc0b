// Knot vectors: the parameter axis of a B-spline.
#pragma once

#include <vector>

#include "base/result.h"

namespace angiospline {

// Degree and knots of a B-spline basis. Immutable. Invariants:
//   1. degree >= 0 and at least 2 (degree + 1) knots;
//   2. knots are finite and do not decrease;
//   3. no knot has a multiplicity above degree + 1;
//   4. the domain [knot(degree), knot(control_point_count)] has positive length;
//   5. degree <= kMaxDegree, so that evaluators can work on the stack.
// False: "the ends are clamped" (a floating end is legal), "spans have positive length".
// Reference: Lyche & Morken, Spline Methods, chapter 2; Piegl & Tiller, The NURBS Book, 2.2.
class KnotVector {
 public:
  static constexpr int kMaxDegree = 31;  // the triple curve of two patches of degree 10 has 29

  // An error names the first broken invariant, its index and its value.
  static Result<KnotVector> make(int degree, std::vector<double> knots);

  // One polynomial span on [first, last]: the Bernstein basis.
  static KnotVector bezier(int degree, double first = 0.0, double last = 1.0);

  // Clamped ends; `breakpoints` strictly increasing, at least two; interior ones get
  // `multiplicity`.
  static KnotVector clamped(int degree, const std::vector<double>& breakpoints,
                            int multiplicity = 1);

  int degree() const { return degree_; }
  int order() const { return degree_ + 1; }
  int control_point_count() const { return static_cast<int>(knots_.size()) - order(); }
  const std::vector<double>& knots() const { return knots_; }
  double operator[](int i) const { return knots_[static_cast<std::size_t>(i)]; }
  double first() const { return knots_[static_cast<std::size_t>(degree_)]; }
  double last() const { return knots_[static_cast<std::size_t>(control_point_count())]; }

  // Index k with knot(k) <= t < knot(k + 1), degree <= k < control_point_count(); t outside the
  // domain gives the first or last span of positive length. `hint` is tried first.
  int span(double t, int hint = -1) const;

  // Greville abscissa of control point i ("node" in the thesis): mean of knots i+1 .. i+degree.
  double greville(int i) const;
  std::vector<double> greville() const;

  // Distinct knots of the domain, ends included, and the multiplicity of a value in the knots.
  std::vector<double> breakpoints() const;
  int multiplicity(double t) const;

  friend bool operator==(const KnotVector& a, const KnotVector& b) {
    return a.degree_ == b.degree_ && a.knots_ == b.knots_;
  }

 private:
  KnotVector(int degree, std::vector<double> knots) : degree_(degree), knots_(std::move(knots)) {}

  int degree_;
  std::vector<double> knots_;
};

}  // namespace angiospline
