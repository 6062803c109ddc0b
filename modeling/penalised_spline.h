// Smooth curves through noisy samples: B-splines with a penalty whose strength the data choose.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "kernel/knot_vector.h"

namespace angiospline {

// A symmetric positive definite matrix of half bandwidth p: row k of column j holds entry (j + k,
// j).
using SymmetricBand = Eigen::MatrixXd;  // p + 1 rows, one column for each column of the matrix

// Replaces A by its Cholesky factor L (A = L L'). False if A is not positive definite. O(n p^2).
bool factorise_band(SymmetricBand& A);

// Solves L L' X = B in place of B, one right-hand side for each column. O(n p) for each.
void solve_band(const SymmetricBand& L, Eigen::MatrixXd& B);

// Least squares with the penalty strength * sum over spans of stiffness * integral of |f''|^2,
// whose minimiser is a smoothing spline when the knots are dense. Holds what does not change with
// the strength.
class PenalisedSpline {
 public:
  // Parameters inside the knots' domain, in any order; one row of `values` and one weight >= 0 for
  // each. Requires clamped knots, at least three samples at different parameters with positive
  // weights.
  PenalisedSpline(const KnotVector& knots, const Eigen::VectorXd& parameters,
                  const Eigen::MatrixXd& values, const Eigen::VectorXd& weights);

  // Relative stiffness of each span, positive; all ones at first.
  void set_stiffness(const Eigen::VectorXd& stiffness);

  // The strength that maximises the restricted likelihood of "smooth function plus white noise"
  // (REML; Wood 2011, J. R. Stat. Soc. B 73), which undersmooths correlated errors less than
  // cross-validation does. Noise is taken to be at least `least_noise` (standard deviation, in the
  // values' unit). Golden section on the logarithm; O(samples + knots) for each of some 40 trials.
  double best_strength(double least_noise) const;

  // Coefficients, one column for each dimension of the values. Rows of `ends`, when not empty, are
  // the values the curve takes at the first and last parameter exactly.
  Eigen::MatrixXd solve(double strength, const Eigen::MatrixXd& ends = {}) const;

  const KnotVector& knots() const { return knots_; }
  int span_count() const { return static_cast<int>(breaks_.size()) - 1; }

 private:
  double criterion(double strength, double least_noise) const;
  SymmetricBand system(double strength) const;

  KnotVector knots_;
  std::vector<double> breaks_;
  Eigen::VectorXd parameters_;
  Eigen::MatrixXd values_;
  Eigen::VectorXd weights_;
  std::vector<int> first_;  // of the basis functions that do not vanish at a sample
  Eigen::MatrixXd basis_;   // one row a sample
  SymmetricBand data_;      // B' W B
  SymmetricBand penalty_;
  Eigen::MatrixXd right_;  // B' W Y
};

}  // namespace angiospline
