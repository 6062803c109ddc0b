// Junctions that lie within one lumen are one junction of more branches.
#pragma once

#include "recovery/imaging/image/image.h"
#include "recovery/imaging/skeleton/vessel_graph.h"

namespace angiospline {

// The graph with every arc between two junctions contracted that is shorter (node to node,
// straight) than `radii` times the larger of the two junctions' distances to the mask's boundary: a
// trifurcation comes out of thinning as two bifurcations a voxel or two apart. Shortest arcs go
// first; the node with the larger distance stays and takes the other's cluster and arcs, whose
// chains are led on to it. Components and cycles are kept; the search starts from the same roots.
// O(arcs log arcs).
VesselGraph merge_close_junctions(const VesselGraph& graph, const Mask& mask, double radii = 1.0);

}  // namespace angiospline
