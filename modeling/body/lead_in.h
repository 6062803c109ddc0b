// The way from a body's end to its centerline, where that turns away too sharply for the wall.
#pragma once

#include <optional>

#include <Eigen/Core>

#include "kernel/spline/curve.h"

namespace angiospline {

struct PathEnd;

struct LeadIn {
  double joins_at = 0.0;      // parameter of the course from which on it is followed
  Eigen::Matrix4Xd samples;   // x, y, z, radius in mm, evenly in its own parameter, the end first
  double largest_bend = 0.0;  // curvature times radius along it
};

// A quintic that leaves `end` along its direction and joins `course` (over [0, 1], nearly even in
// arc length) with its tangent and curvature: the one that joins it earliest of those whose
// curvature times radius stays below `tightest`, or, if none does, the least bent. `from_last`: the
// end is the course's last, and the direction still points along its travel. Joins no later than
// `most` of the course. Nothing if the end has no direction or the course is degenerate.
// O(candidates), about a hundred quintics.
std::optional<LeadIn> find_lead_in(const BSplineCurve<4>& course, bool from_last,
                                   const PathEnd& end, double tightest, double most);

}  // namespace angiospline
