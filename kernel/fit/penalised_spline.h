// Smooth curves through noisy samples: B-splines with a penalty whose strength the data choose.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "kernel/numerics/banded.h"
#include "kernel/spline/knot_vector.h"

namespace angiospline {

// The least-squares problem left for the two end values when all other coefficients are eliminated:
// minimise e' matrix e - 2 e' right over the 2 x D end values e.
struct CondensedEnds {
  Eigen::Matrix2d matrix;
  Eigen::MatrixXd right;
};

// Least squares with the penalty strength * sum over spans of stiffness * integral of the squared
// second (or third) derivative, whose minimiser is a smoothing spline when the knots are dense. The
// basis is evaluated once; strength, weights and stiffness may change from solve to solve.
class PenalisedSpline {
 public:
  // Parameters inside the knots' domain, in any order; one row of `values` and one weight >= 0 for
  // each. `order` of the penalised derivative: 2 or 3. Requires clamped knots of a higher degree,
  // at least order + 1 samples at different parameters with positive weights.
  PenalisedSpline(const KnotVector& knots, const Eigen::VectorXd& parameters,
                  const Eigen::MatrixXd& values, const Eigen::VectorXd& weights, int order = 2);

  void set_weights(const Eigen::VectorXd& weights);
  void set_values(const Eigen::MatrixXd& values);
  void set_stiffness(const Eigen::VectorXd& stiffness);  // of each span, positive; ones at first

  // Minus twice the restricted log likelihood (REML) of "smooth function plus white noise" at this
  // strength, up to a constant: the strength that makes it least is the data's own choice, and
  // undersmooths correlated errors less than cross-validation's. Noise is taken to be at least
  // `least_noise` (standard deviation, in the values' unit). O(samples + knots).
  // Reference: Wood 2011, J. R. Stat. Soc. B 73; Wahba 1985, Ann. Stat. 13.
  double criterion(double strength, double least_noise) const;

  // Coefficients, one column for each dimension of the values. Rows of `ends`, when not empty, are
  // the values the curve takes at the first and last parameter exactly. O(samples + knots).
  Eigen::MatrixXd solve(double strength, const Eigen::MatrixXd& ends = {}) const;
  CondensedEnds condensed_ends(double strength) const;

  // The curve's values at the parameters it was made with.
  Eigen::MatrixXd values_at_samples(const Eigen::MatrixXd& coefficients) const;

  const KnotVector& knots() const { return knots_; }
  const std::vector<double>& breaks() const { return breaks_; }
  int span_count() const { return static_cast<int>(breaks_.size()) - 1; }

 private:
  void collect_right();
  SymmetricBand system(double strength) const { return data_ + strength * penalty_; }

  int order_;  // of the penalised derivative
  KnotVector knots_;
  std::vector<double> breaks_;
  Eigen::MatrixXd values_;
  Eigen::VectorXd weights_;
  std::vector<int> first_;   // of the basis functions that do not vanish at a sample
  Eigen::MatrixXd basis_;    // one row a sample
  Eigen::MatrixXd bending_;  // second derivatives of the basis at the penalty's quadrature points
  SymmetricBand data_;       // B' W B
  SymmetricBand penalty_;
  Eigen::MatrixXd right_;  // B' W Y
};

}  // namespace angiospline
