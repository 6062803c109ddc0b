// What a person measures of a vessel: its length and its radii.
#pragma once

#include <Eigen/Core>

#include "modeling/tree/centerline_tree.h"

namespace angiospline {

struct BranchMorphometry {
  double length_mm = 0.0;  // of the polyline
  // The mean over the length, the radius varying linearly between points; over the points where the
  // branch has no length.
  double mean_radius_mm = 0.0;
  double min_radius_mm = 0.0;  // of the points
  double max_radius_mm = 0.0;
};

// Requires a branch with at least one point and a radius for each. O(points).
BranchMorphometry morphometry(const CenterlineBranch& branch);

// How far along its polyline each point of a branch lies: 0 for the first, then never less than
// before.
Eigen::VectorXd arc_lengths_mm(const CenterlineBranch& branch);

}  // namespace angiospline
