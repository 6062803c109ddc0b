// A smoothing spline brought within its rules: no sample moves too far, no bend is too sharp.
#pragma once

#include <Eigen/Core>

#include "base/vector.h"
#include "kernel/fit/penalised_spline.h"
#include "kernel/spline/curve.h"
#include "modeling/tree/branch_samples.h"

namespace angiospline {

// What a path must keep to. Holds references.
struct PathLimits {
  const BranchSamples& samples;
  const PenalisedSpline& spline;      // through the samples' points
  const BSplineCurve<1>& log_radius;  // over the same parameters
  double largest_move = 0.0;          // of a sample, in local radii
  double largest_bend = 0.0;          // curvature times radius
  double first_visible = 0.0;         // between these parameters bends reach the wall; outside they
  double last_visible = 0.0;          // lie inside junctions

  bool is_visible(double t) const { return t >= first_visible && t <= last_visible; }
};

// A path's coefficients and by how much it breaks the rules: 0 if it keeps them.
struct Followed {
  Eigen::MatrixXd coefficients;
  double excess = 0.0;
};

// The spline whose samples keep the largest move, stiffened span by span where it bends too
// sharply. For a given stiffness it is the minimiser of misfit plus bending over all curves that
// keep the largest move, found by the alternating direction method of multipliers. Rows of `ends`:
// the first and last point, kept exactly. Where the rules cannot be kept, what breaks them least,
// moves first. O(rounds x samples).
// Reference: Boyd, Parikh, Chu, Peleato, Eckstein 2011, Distributed Optimization and Statistical
// Learning via the Alternating Direction Method of Multipliers, Found. Trends Mach. Learn. 3,
// ch. 3.
Followed follow_rules(const PathLimits& limits, double strength, const Eigen::MatrixXd& ends);

// Curvature times `radius` from the first two derivatives; infinite where the curve stands still.
double bend_from(const Vec3& d1, const Vec3& d2, double radius);

}  // namespace angiospline
