// The inputs that the kernel's benchmarks share, ours and the peers'.
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "kernel/spline/curve.h"
#include "kernel/spline/surface.h"

namespace angiospline::bench {

KnotVector uniform_knots(int degree, int count);

// Bi-quintic, 20 x 20 control points, a bumpy sheet.
BSplineSurface<3> sheet();

// Grid of 200 x 200 parameters over the sheet, in grid order or shuffled (the same ones).
Eigen::Matrix2Xd grid_parameters();
Eigen::Matrix2Xd shuffled(Eigen::Matrix2Xd parameters);

// A quintic helix: radius 10, pitch 5, five turns; Gaussian noise on the control points.
BSplineCurve<3> helix(int count, double noise);

// A bent tube of varying radius, bi-quintic, u along it.
BSplineSurface<3> tube(int along, int around);

// A torus of wavy radius, bi-quintic, closed in both directions, over [0, 1] x [0, 1].
BSplineSurface<3> ring(int along, int around);

// The largest distance at equal parameters, densely sampled.
double largest_distance(const BSplineCurve<3>& a, const BSplineCurve<3>& b);
double largest_distance(const BSplineSurface<3>& a, const BSplineSurface<3>& b);

// The time of `ours` over that of `theirs`, CPU time, the two run in turn until each has had some
// 20 turns: what slows the machine down for a while slows both. Medians.
double ratio_in_turn(const std::function<void()>& ours, const std::function<void()>& theirs);

// The net with i running fastest, as SISL wants it.
std::vector<double> u_fastest(const BSplineSurface<3>& surface);
BSplineSurface<3> from_u_fastest(const KnotVector& u, const KnotVector& v, const double* net);

}  // namespace angiospline::bench
