// The curve a body is swept along: the smoothed centerline, bent so that it meets its two ends.
#pragma once

#include <vector>

#include "base/vector.h"
#include "kernel/spline/curve.h"

namespace angiospline {

// What holds at one end of the path. With a direction, the path leaves (or arrives) along it and
// its radius has slope zero there, so that a surface beyond can continue it smoothly.
struct PathEnd {
  Vec3 point_mm = Vec3::Zero();
  double radius_mm = 0.0;
  Vec3 direction = Vec3::Zero();  // unit, along the path's travel; zero: free
};

struct BodyPath {
  BSplineCurve<4> curve;      // (x, y, z, radius) in mm over [0, 1]
  double largest_bend = 0.0;  // curvature times radius, largest along the path
  double narrowed = 0.0;      // largest part of the radius given up so that a bend does not fold
};

// Bends tighter than this (curvature times radius) are relaxed; 1 is where a tube folds. Smoothing
// keeps to 0.8, so that a smoothed path is followed as it is.
inline constexpr double kTightestBend = 0.81;

// Stiffening may move the path by so many radii. If that would narrow the radius by more than half
// of the share below, or leave the target by more than one radius, other ways are tried (one
// radius, then ends led in, then any move), and the one that gives up least of either is taken;
// what cuts off more than four radii of the vessel, or narrows it by more than four tenths, only
// if nothing else is left.
inline constexpr double kLargestPathMove = 0.3;
inline constexpr double kMostNarrowed = 0.1;

// Follows `target` (columns x, y, z, radius in mm; at least two, not all in one place) between the
// ends. What the target misses at the ends is made up by an elastic correction that dies out within
// some four radii; bends tighter than kTightestBend are stiffened. Where the target turns away from
// an end's direction too sharply even so, it is joined farther on (modeling/body/lead_in.h). If a
// bend stays too tight the radius is narrowed there to kTightestBend / curvature. Linear in the
// number of columns and in length / radius. For a wall that folds on the path that was chosen so:
// kNarrower gives more of the radius way in tight bends; kAnyMove takes the last of these ways
// only.
enum class PathFreedom { kNearTarget, kNarrower, kAnyMove };
BodyPath fit_body_path(const Eigen::Matrix4Xd& target, const PathEnd& start, const PathEnd& end,
                       PathFreedom freedom = PathFreedom::kNearTarget);

// The largest distance of points (columns x, y, z, radius) from the curve, in mm, and that in the
// radius there. Each is looked for within ten radii of way from its own parameter in [0, 1].
struct AxisDeparture {
  double mm = 0.0;
  double radii = 0.0;
};
AxisDeparture departure_from(const BSplineCurve<4>& curve, const Eigen::Matrix4Xd& points,
                             const std::vector<double>& parameters);

}  // namespace angiospline
