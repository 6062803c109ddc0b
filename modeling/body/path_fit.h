// One fit of a body's path: the target as a spline, an elastic correction that meets the ends, and
// bends that are stiffened until none is too tight.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "kernel/fit/penalised_curve.h"
#include "kernel/spline/curve.h"
#include "modeling/body/path.h"

namespace angiospline {

// Points of a target (x, y, z, radius) with their arc length over the total length.
struct Rail {
  std::vector<double> parameters;
  Eigen::Matrix4Xd points;
  double length_mm = 0.0;
  double mean_radius_mm = 0.0;

  double radius_in_parameter() const { return mean_radius_mm / length_mm; }
};

// The target between the ends' own points. Requires points that are not all in one place.
Rail make_rail(const Eigen::Matrix4Xd& target, const PathEnd& start, const PathEnd& end);

// How tightly a curve bends at a parameter.
struct Bend {
  double parameter;
  double curvature;  // 1 / mm; infinite where the curve stands still
  double radius;     // mm

  double tightness() const { return curvature * radius; }
};
Bend bend_at(const BSplineCurve<4>& curve, double t);
std::vector<Bend> bends_of(const BSplineCurve<4>& curve, int count);
double tightest(const std::vector<Bend>& bends);

// Minimises the integral of |delta|^2 + 4 r^4 |delta''|^2 over corrections delta that hold the
// ends: a beam on an elastic foundation, which dies out within some four radii (M. Hetenyi, Beams
// on Elastic Foundation, 1946, chapter II).
class PathFit {
 public:
  // `largest_move`: radii by which stiffening may move the path.
  PathFit(Rail rail, const PathEnd& start, const PathEnd& end, double largest_move);

  // Where the path would bend too tightly near an end, the target is led in from there.
  void lead_in();

  // The path with its bends as stiff as they are.
  BSplineCurve<4> solve() const;

  // Stiffens the spans of the path in which it bends too tightly, and their neighbours, unless it
  // has left its target there already: then the radius has to give way. False when nothing was
  // stiffened.
  bool stiffen(const BSplineCurve<4>& curve);

  const BSplineCurve<4>& course() const { return course_; }     // before any stiffening
  AxisDeparture departure(const BSplineCurve<4>& curve) const;  // from the target as it was given
  int span_count() const { return static_cast<int>(stiffness_.size()); }

 private:
  void prepare();
  SplineFitProblem target_problem() const;
  BSplineCurve<4> target_spline() const;
  double tightest_within(double from, double to) const;
  std::vector<char> moved_spans(const BSplineCurve<4>& curve) const;
  KnotVector make_knots() const;
  std::vector<double> slack() const;

  Rail rail_;
  Rail target_;  // as given, before it was led in or resampled
  PathEnd start_;
  PathEnd end_;
  double largest_move_;
  KnotVector knots_;
  std::vector<double> stiffness_;  // of each span
  BSplineCurve<4> course_;
};

}  // namespace angiospline
