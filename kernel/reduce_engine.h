// Least-squares trials for data reduction, one direction at a time. Not part of the installed
// interface.
#pragma once

#include <optional>
#include <vector>

#include "base/result.h"
#include "kernel/knot_algebra.h"

namespace angiospline {

// One direction of a reduction. `points` are control_point_count() blocks of `stride` doubles, in
// groups of `group` that are measured in the Euclidean norm.
struct ReductionProblem {
  const KnotVector& knots;
  const double* points;
  int stride;
  int group;
  double tolerance;
  int held_first;
  int held_last;
  const std::vector<Knot>& kept;
  int polish;
};

struct DirectionResult {
  KnotVector knots;
  std::vector<double> points;  // control_point_count() blocks of the same stride
  double error_bound;
  int trials;
};

// The fewest control points found whose error bound is within the tolerance (the original, with
// bound 0, if none is).
DirectionResult reduce_direction(const ReductionProblem& problem);

// The least-squares spline over these interior knots, if its error bound is within the tolerance.
std::optional<DirectionResult> fit_direction(const ReductionProblem& problem,
                                             const std::vector<double>& interior);

// No point of the difference of two splines over the same domain, given by blocks of control
// points, is longer than this: control polygon of the difference over all knots of both, then, if
// that is above `enough`, with the spans concerned cut in four.
double difference_bound(const KnotVector& a_knots, const double* a, const KnotVector& b_knots,
                        const double* b, int stride, int group, double enough);

// The first broken requirement of the options, or nothing.
std::optional<Error> reduction_option_error(const KnotVector& knots, double tolerance,
                                            int held_first, int held_last);

}  // namespace angiospline
