// Least-squares trials for data reduction, one direction at a time. Not part of the installed
// interface.
#pragma once

#include <optional>
#include <vector>

#include "kernel/numerics/banded.h"
#include "kernel/numerics/compact_rows.h"
#include "kernel/spline/knot_algebra.h"

namespace angiospline {

// What says that a trial is within the tolerance: a bound on the whole spline, or the error at the
// samples where a later bound on more than this direction has the last word.
enum class Proof { kBound, kSamples };

// One direction of a reduction. `points` are control_point_count() blocks of `stride` doubles, in
// groups of `group` that are measured in the Euclidean norm. `closed`: knots repeat and control
// points wrap, and so shall those of the result; nothing is held then.
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
  bool closed = false;
  Proof proof = Proof::kBound;
};

// A choice of interior knots, increasing; equal values are a multiple knot.
using Interior = std::vector<double>;

// A least-squares spline over the ends of the original and some interior knots.
struct Trial {
  Interior interior;
  KnotVector knots;
  std::vector<double> points;  // control_point_count() blocks
  int step;                    // every how many samples were used
  double error;                // the largest at those; infinite if there is no solution
  std::vector<double> errors;  // squared, one for each sample, zero at those not used
};

// Solves and measures trials. The samples are the Greville points of the original (of one period
// where it is closed). Linear in samples and control points for each trial; memory is used again.
class TrialSolver {
 public:
  explicit TrialSolver(const ReductionProblem& problem);

  int trials() const { return trials_; }
  long work() const { return work_; }  // samples used by them all
  // Fewer than two samples for each of many knots: noise decides, and weights would follow the
  // samples and not the error between them.
  bool dense(int knots) const {
    constexpr int kMany = 64;  // fewer cost nothing to try
    return knots > kMany && 2 * static_cast<std::size_t>(knots) > nodes_.size();
  }
  const std::vector<double>& nodes() const { return nodes_; }  // where the samples are
  const std::vector<double>& norm() const { return norm_; }    // weights of the discrete norm

  // Least squares at every step-th sample (the last one always).
  Trial attempt(const Interior& interior, int step, const std::vector<double>& weights);

  // The trial, or one over the same knots with weights that follow its error towards the uniform
  // norm (Lawson), if it is within the tolerance; and its bound. Requires that all samples were
  // used.
  struct Confirmed {
    Trial trial;
    double bound;
  };
  std::optional<Confirmed> confirm(Trial trial, int passes);

 private:
  KnotVector trial_knots(const Interior& interior) const;
  void hold_ends(const KnotVector& knots, std::vector<double>& points) const;
  bool solve(Trial& trial, const std::vector<double>& weights);
  bool solve_closed(Trial& trial, const std::vector<double>& weights) const;
  void measure(Trial& trial);
  int sample(int row, int step) const;  // of a row of the trial's matrix

  const ReductionProblem& problem_;
  int p_;
  int stride_;
  std::vector<double> nodes_;
  std::vector<double> values_;  // of the original there
  std::vector<double> norm_;
  int trials_ = 0;
  long work_ = 0;

  // Of the last trial; here to keep their memory, and the matrix for new weights.
  std::vector<double> parameters_;
  CompactRows matrix_{1, 1, 1};
  std::optional<KnotVector> matrix_knots_;
  int matrix_step_ = 0;
  std::vector<double> difference_;
};

}  // namespace angiospline
