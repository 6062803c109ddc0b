// Radii along a branch from what its sections and its voxels say.
#pragma once

#include "recovery/centerlines/branch_points.h"

namespace angiospline {

// One radius in mm for each point of a chain: open sections take the value of the nearest closed
// ones, counts of voxels correct them so that the mask's volume is kept, a median of five removes
// single outliers, and a running mean over a radius the noise of voxels. Without a closed section:
// the distances to the wall. O(points * radii).
Eigen::VectorXd radii_along(const VesselGraph& graph, const BranchPoints& points,
                            const SmoothingChain& chain);

}  // namespace angiospline
