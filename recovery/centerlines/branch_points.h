// The points of a vessel graph's branches, as unknowns that are moved to the middle of the lumen.
#pragma once

#include <vector>

#include "base/vector.h"
#include "recovery/centerlines/axis_smoothing.h"
#include "recovery/centerlines/centerlines_from_graph.h"

namespace angiospline {

// All points of all branches: the graph's nodes first, under their numbers, then the inner points
// of each arc.
struct BranchPoints {
  std::vector<SmoothingChain> chains;  // one for each arc
  Points3 voxels_mm;                   // where the axis had them
  Points3 at_mm;                       // where they are now
  Eigen::VectorXd inscribed_mm;        // distance of the voxel to the wall
  Eigen::VectorXd radius_mm;           // of the section where it is closed, otherwise 0
  Eigen::VectorXd counted;             // the same by counting voxels, over radius_mm; 0: not known
  std::vector<bool> in_junction;       // within a junction's lumen, where sections mean nothing
};

// The points where the axis has them, nothing measured yet. Unless tips stay at the skeleton's
// ends, tails that bend into the corner of a free end are cut. Requires: the axis lies in the mask.
// O(voxels of the axis), and the distances to the wall there.
BranchPoints branch_points(const VesselGraph& graph, const Mask& mask, TipRule tips);

// Chains for the solver: those of the points, but a branch that closes on itself bends across its
// node too.
std::vector<SmoothingChain> solver_chains(const VesselGraph& graph, const BranchPoints& points);

// Unit directions along the chains at every inner point and free end, 3 x points; zero where a
// chain has no length.
Points3 branch_tangents(const VesselGraph& graph, const BranchPoints& points);

// Which points are farther along their branch from every junction's lumen than `reach_mm` of them:
// a slab that reaches into a junction holds more than its branch.
std::vector<bool> clear_of_junctions(const BranchPoints& points, const Eigen::VectorXd& reach_mm);

}  // namespace angiospline
