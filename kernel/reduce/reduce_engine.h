// The search for the fewest knots, one direction at a time. Not part of the installed interface.
#pragma once

#include <optional>
#include <vector>

#include "base/result.h"
#include "kernel/reduce/reduce_trial.h"

namespace angiospline {

struct DirectionResult {
  KnotVector knots;
  std::vector<double> points;  // control_point_count() blocks of the same stride
  double error_bound;          // or the largest error at the samples (Proof::kSamples)
  int trials;
};

// The fewest control points found that are within the tolerance (the original, with bound 0, if
// there are none).
DirectionResult reduce_direction(const ReductionProblem& problem);

// The least-squares spline over these interior knots, if it is within the tolerance.
std::optional<DirectionResult> fit_direction(const ReductionProblem& problem,
                                             const Interior& interior);

}  // namespace angiospline
