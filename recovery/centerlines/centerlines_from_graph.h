// The last step of the first way in: a vessel graph and its mask become a centerline tree in mm.
#pragma once

#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "modeling/tree/centerline_tree.h"
#include "recovery/imaging/image/image.h"
#include "recovery/imaging/skeleton/vessel_graph.h"

namespace angiospline {

// Where a branch stops that ends freely.
enum class TipRule {
  kSkeleton,  // at the last voxel of the axis
  kFlatCap,   // where a flat cap keeps the lumen's volume: at the cut of a vessel that was cut, two
              // thirds of a radius beyond the centre of a half sphere
};

struct CenterlineOptions {
  TipRule tips = TipRule::kFlatCap;
  // Wavelength along the branch that is halved in amplitude: this many radii, at least so many
  // voxels.
  double smoothing_radii = 2.0;
  double smoothing_voxels = 6.0;
  // No point moves farther from the axis of voxels than this many local radii, or one voxel's
  // diagonal.
  double largest_move_radii = 0.5;
};

// One node for each node of the graph, one branch for each arc, in the same order; one point about
// every voxel. Points lie in the middle of the lumen at sub-voxel accuracy: each is moved to the
// centre of its cross-section where that is closed, and the whole is smoothed by a least-squares
// spline (second differences along branches) which bridges the sections that open into a junction.
// Radii are those of circles of the section's area, corrected along each branch so that they keep
// the volume of the mask's voxels; within a junction's lumen a branch keeps the radius it has
// outside. Tails of the axis that bend into an end's corner are cut and the tip is
// set by `tips`. Inlets are the roots of the graph's components that are ends. Names: node
// "v<x>_<y>_<z>" by its voxel; a branch by the node at its far end from the root, with
// "_2", "_3" where several lead there. Components of one voxel become no branch and are left out,
// which `assumptions` says, together with the rules above.
// O(points * rays). Errors: no branch at all; stopped on request.
// Requires: the graph's axis lies in the mask, on the same grid.
Result<CenterlineTree> centerlines_from_graph(const VesselGraph& graph, const Mask& mask,
                                              const CenterlineOptions& options = {},
                                              const Progress& progress = {});

// The end with the largest median distance to the wall over its branch's outer half, for each
// component that has an end and a branch: the likely inlets. Ties go to the lower node.
std::vector<int> thickest_ends(const VesselGraph& graph, const Mask& mask);

}  // namespace angiospline
