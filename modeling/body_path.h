// The curve a body is swept along: the smoothed centerline, bent so that it meets its two ends.
#pragma once

#include "base/vector.h"
#include "kernel/curve.h"

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

// Bends tighter than this (curvature times radius) are relaxed; 1 is where a tube folds.
inline constexpr double kTightestBend = 0.75;

// Stiffening may move the path by so many radii, unless the radius would be narrowed by more than
// the share below: then by one radius, then by as much as it takes.
inline constexpr double kLargestPathMove = 0.3;
inline constexpr double kMostNarrowed = 0.4;

// Follows `target` (columns x, y, z, radius in mm; at least two, not all in one place) between the
// ends. What the target misses at the ends is made up by an elastic correction that dies out within
// some four radii; bends tighter than kTightestBend are stiffened until they open or the path has
// moved by about kLargestPathMove radii. If a bend stays too tight the radius is narrowed there to
// kTightestBend / curvature.
// Linear in the number of columns and in length / radius.
BodyPath fit_body_path(const Eigen::Matrix4Xd& target, const PathEnd& start, const PathEnd& end);

}  // namespace angiospline
