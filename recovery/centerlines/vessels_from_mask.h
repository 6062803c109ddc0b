// From a mask to centerlines in one call: thinning, labels, graph, pruning, radii, smoothing.
#pragma once

#include <optional>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "modeling/tree/centerline_tree.h"
#include "recovery/centerlines/centerlines_from_graph.h"
#include "recovery/imaging/mask/topology_numbers.h"
#include "recovery/imaging/skeleton/contacts.h"
#include "recovery/imaging/skeleton/pruning.h"
#include "recovery/imaging/skeleton/thinning.h"
#include "recovery/imaging/skeleton/vessel_graph.h"

namespace angiospline {

struct VesselsOptions {
  ThinningOptions thinning{Connectivity::k26, ThinningOrder::kDistance};  // fewest twigs
  PruningOptions pruning;    // its connectivity is that of the thinning
  double merge_radii = 1.0;  // junctions nearer to each other than so many radii are one; 0: never
  CenterlineOptions centerlines;
  // Where flow enters: the node nearest to each is the root and, if it is an end, the inlet of its
  // component. A component without one takes its thickest end.
  std::vector<Vec3> roots_mm;
  std::optional<Mask> skeleton;  // an axis of the mask that is taken instead of thinning
  bool keep_twigs = false;       // nothing is pruned
  // Vessels that touch but do not join are parted and the mask is thinned anew, which an axis given
  // as `skeleton` does not survive.
  bool cut_contacts = false;
};

struct Vessels {
  Mask skeleton;        // pruned, one voxel thick
  VesselGraph graph;    // rooted at the inlets
  CenterlineTree tree;  // nodes and branches in the graph's order, without lonely voxels
  std::vector<MaskContact> contacts;  // found before anything was cut
  int contacts_cut = 0;
  int twigs = 0;           // branches pruned
  int merged = 0;          // junctions that became part of a neighbour
  int hidden_cycles = 0;   // tunnels within junctions, too small to be loops of the tree
  TopologyNumbers before;  // of the mask
  TopologyNumbers after;   // of the skeleton: components, cavities and cycles are the same
};

// Everything between a mask and its centerline tree. The mask is used as it is: fill its cavities
// and holes first. Errors: an empty or full mask; no branch; a skeleton
// on another grid; stopped on request.
Result<Vessels> vessels_from_mask(const Mask& mask, const VesselsOptions& options = {},
                                  const Progress& progress = {});

}  // namespace angiospline
