// The axis as a graph: nodes, arcs, levels, parents and children (thesis 4.3.1).
#pragma once

#include <string>
#include <vector>

#include "recovery/imaging/image/image.h"
#include "recovery/imaging/skeleton/labels.h"

namespace angiospline {

// An end (at most one arc) or a junction. A ring without end or junction gets one node of two arc
// ends, its first voxel in the image.
struct VesselNode {
  Voxel voxel{0, 0, 0};        // the end voxel, or the main point of the junction
  std::vector<Voxel> cluster;  // all voxels of the junction; the voxel alone for an end
  std::vector<int> arcs;       // arcs that meet here; an arc onto itself is listed twice
  std::vector<int> parents;    // nodes, in growing order; twice if two arcs lead here
  std::vector<int> children;   // nodes, in growing order; twice if two arcs lead there
  int level = 0;               // arcs to the root of the component
  int component = 0;
  int cluster_cycles = 0;    // tunnels and cavities within the cluster,
  int cluster_cavities = 0;  // which the graph does not show

  bool is_end() const { return arcs.size() < 2; }
};

// A branch: `from` is the node the search came from.
struct VesselArc {
  int from = -1;
  int to = -1;
  std::vector<Voxel> voxels;  // from node voxel to node voxel, both included, each next to the last
};

// Any number of components, each numbered by level-order search from its root; the first node of a
// component is its root.
struct VesselGraph {
  ImageGrid grid;
  std::vector<VesselNode> nodes;
  std::vector<VesselArc> arcs;

  int component_count() const;
  int cycle_count() const;  // arcs - nodes + components
  int multiple_parent_count()
      const;  // parents beyond the first (beyond none at a root): equal to it
};

// The graph of a labelled axis. In each component the search starts at the first of `roots` (voxels
// of the image, need not be on the axis) that lies nearest to one of its nodes, otherwise at its
// first end in the image, otherwise at its first node. Every root claims the component of the node
// nearest to it. Arcs lead through mutual voxels by the fewest voxels. O(voxels of the axis + nodes
// * roots).
VesselGraph vessel_graph(const SkeletonLabels& labels, const std::vector<Voxel>& roots = {});

// The same graph searched again from other nodes, one for each component that shall have another
// root (of several in one component the first rules). Nodes and arcs are renumbered.
VesselGraph rooted_at(const VesselGraph& graph, const std::vector<int>& root_nodes);

// The table the thesis prints (figures 7.18 and 7.22): for each node a line with its voxel, level
// and number, then its parents and its children.
std::string level_order_table(const VesselGraph& graph);

}  // namespace angiospline
