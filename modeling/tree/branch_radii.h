// The radius of a branch as a smooth function: a penalised spline through its logarithms.
#pragma once

#include <Eigen/Core>

#include "kernel/fit/penalised_spline.h"
#include "kernel/spline/curve.h"
#include "modeling/tree/branch_samples.h"

namespace angiospline {

// Logarithms, so that radii stay positive and a change counts by its share of the radius.
class RadiusSpline {
 public:
  // `knots`: those of the path, over the samples' parameters.
  RadiusSpline(const BranchSamples& samples, const KnotVector& knots);

  // The restricted likelihood's verdict on a strength (kernel/fit/penalised_spline.h).
  double criterion(double strength) const;

  // Smooths with this strength, or as much more weakly as it takes that no radius changes too much
  // and the curve does not swing out between two of them (RadiusRules). Where radii jump too far
  // for that, with finer spans if these break the rules less. Requires the samples it was made of.
  void smooth(const BranchSamples& samples, double strength);

  // Logarithm of the radius over the samples' parameters (after smooth).
  BSplineCurve<1> log_radius() const;

 private:
  struct Trial {
    Eigen::MatrixXd coefficients;
    double broken = 0.0;  // the rules: 1 if it just keeps them
  };
  double broken_by(const BranchSamples& samples, const Eigen::MatrixXd& C) const;
  Trial weakened(const BranchSamples& samples, double strength) const;

  KnotVector knots_;
  PenalisedSpline spline_;
  int path_spans_;
  Eigen::MatrixXd coefficients_;
};

}  // namespace angiospline
