#include "modeling/tree/branch_radii.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "modeling/tree/rules.h"

namespace angiospline {

RadiusSpline::RadiusSpline(const BranchSamples& samples, const KnotVector& knots)
    : knots_(knots),
      spline_(knots_, samples.parameters, samples.radii.array().log().matrix(),
              samples.radius_weights),
      path_spans_(spline_.span_count()) {}

double RadiusSpline::criterion(double strength) const {
  return spline_.criterion(strength, StrengthRules::kLeastNoise);
}

BSplineCurve<1> RadiusSpline::log_radius() const {
  return BSplineCurve<1>(knots_, coefficients_.transpose());
}

// By how much a smoothed radius breaks its rules, 1 if it just keeps them: no sample changes too
// much, and between two samples nothing swings out of what lies between them.
double RadiusSpline::broken_by(const BranchSamples& samples, const Eigen::MatrixXd& C) const {
  const Eigen::VectorXd y = samples.radii.array().log();
  const Eigen::VectorXd change = (spline_.values_at_samples(C).col(0) - y).cwiseAbs();
  const BSplineCurve<1> log_r(knots_, C.transpose());
  const Eigen::Index last = y.size() - 1;
  double worst = 0;
  for (Eigen::Index i = 0; i <= last; ++i) {
    const double before = i > 0 ? std::abs(y(i) - y(i - 1)) : 0.0;
    const double after = i < last ? std::abs(y(i) - y(i + 1)) : 0.0;
    if (samples.radius_weights(i) > 0) {
      worst = std::max(worst, change(i) / (RadiusRules::kChange + 0.5 * std::max(before, after)));
    }
    if (i == last || samples.radius_weights(i) == 0 || samples.radius_weights(i + 1) == 0) {
      continue;
    }

    // A polynomial that jumps overshoots on both sides of the jump.
    const double allowed = RadiusRules::kSwing + 0.5 * after;
    for (const double f : {0.25, 0.5, 0.75}) {
      const double t = (1 - f) * samples.parameters(i) + f * samples.parameters(i + 1);
      const double value = log_r.at(t)(0);
      const double out =
          std::max(value - std::max(y(i), y(i + 1)), std::min(y(i), y(i + 1)) - value);
      worst = std::max(worst, out / allowed);
    }
  }
  return worst;
}

// Weakens the smoothing until the rules are kept; where radii jump too far for that the strength is
// taken that breaks them least.
RadiusSpline::Trial RadiusSpline::weakened(const BranchSamples& samples, double strength) const {
  Trial best{{}, std::numeric_limits<double>::infinity()};
  for (int trial = 0; trial < RadiusRules::kTrials; ++trial, strength *= 0.5) {
    Eigen::MatrixXd C = spline_.solve(strength);
    const double broken = broken_by(samples, C);
    if (broken < best.broken || best.coefficients.size() == 0) best = {std::move(C), broken};
    if (best.broken <= 1) break;
  }
  return best;
}

void RadiusSpline::smooth(const BranchSamples& samples, double strength) {
  Trial found = weakened(samples, strength);
  coefficients_ = std::move(found.coefficients);
  if (found.broken <= 1) return;

  // Radii that jump get spans as fine as their samples: the path's own are half a mean radius long,
  // and a curve that cannot follow a jump swings on both sides of it.
  const Eigen::Index last = samples.parameters.size() - 1;
  const double spacing = (samples.parameters.tail(last) - samples.parameters.head(last)).minCoeff();
  const int spans =
      std::clamp(static_cast<int>(knots_.last() / spacing), path_spans_,
                 static_cast<int>(RadiusRules::kFinerSpans * samples.parameters.size()));
  RadiusSpline finer(samples,
                     KnotVector::clamped(knots_.degree(), even_breaks(knots_.last(), spans)));
  Trial again = finer.weakened(samples, strength);
  if (again.broken >= found.broken) return;
  knots_ = std::move(finer.knots_);
  spline_ = std::move(finer.spline_);
  coefficients_ = std::move(again.coefficients);
}

}  // namespace angiospline
