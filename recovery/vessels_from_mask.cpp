#include "recovery/vessels_from_mask.h"

#include <algorithm>

#include <fmt/format.h>

#include "recovery/junction_merging.h"

namespace angiospline {
namespace {

int nearest_node(const VesselGraph& graph, const Vec3& point_mm) {
  const auto nearest = std::min_element(
      graph.nodes.begin(), graph.nodes.end(), [&](const VesselNode& a, const VesselNode& b) {
        return (graph.grid.world_mm(a.voxel) - point_mm).squaredNorm() <
               (graph.grid.world_mm(b.voxel) - point_mm).squaredNorm();
      });
  return static_cast<int>(nearest - graph.nodes.begin());
}

Result<PrunedSkeleton> pruned_axis(const Mask& mask, const VesselsOptions& options,
                                   const Progress& progress) {
  if (options.skeleton && options.skeleton->grid.size != mask.grid.size) {
    return fail({ErrorKind::kBadInput,
                 "skeleton and mask differ in size",
                 {},
                 {},
                 "both must lie on one grid"});
  }
  Result<Mask> axis = options.skeleton ? *options.skeleton : thin(mask, options.thinning, progress);
  if (!axis) return fail(axis.error());
  const Connectivity connectivity = options.thinning.connectivity;
  if (options.keep_twigs) {
    PrunedSkeleton whole;
    whole.graph = vessel_graph(label_skeleton(*axis, connectivity));
    whole.skeleton = std::move(*axis);
    return whole;
  }
  PruningOptions pruning = options.pruning;
  pruning.connectivity = connectivity;
  return prune_twigs(mask, std::move(*axis), pruning, progress);
}

}  // namespace

Result<Vessels> vessels_from_mask(const Mask& mask, const VesselsOptions& options,
                                  const Progress& progress) {
  Vessels vessels;
  const Connectivity connectivity = options.thinning.connectivity;
  vessels.before = topology_numbers(mask, connectivity);
  if (vessels.before.components == 0)
    return fail(
        {ErrorKind::kBadInput, "mask is empty", {}, {}, "at least one voxel must be foreground"});
  Result<PrunedSkeleton> pruned = pruned_axis(mask, options, progress);
  if (!pruned) return fail(pruned.error());
  vessels.skeleton = std::move(pruned->skeleton);
  vessels.twigs = pruned->twigs;
  vessels.after = topology_numbers(vessels.skeleton, connectivity);
  const VesselGraph graph = merge_close_junctions(pruned->graph, mask, options.merge_radii);
  vessels.merged = static_cast<int>(pruned->graph.nodes.size() - graph.nodes.size());
  for (const VesselNode& node : graph.nodes) vessels.hidden_cycles += node.cluster_cycles;
  std::vector<int> roots;
  for (const Vec3& root : options.roots_mm) roots.push_back(nearest_node(graph, root));
  const std::size_t given = roots.size();
  for (const int n : thickest_ends(graph, mask)) roots.push_back(n);
  vessels.graph = rooted_at(graph, roots);  // the first root in a component rules: the given one
  Result<CenterlineTree> tree =
      centerlines_from_graph(vessels.graph, mask, options.centerlines, progress);
  if (!tree) return fail(tree.error());
  vessels.tree = std::move(*tree);
  for (const int inlet : vessels.tree.inlets)
    vessels.tree.assumptions.push_back(
        fmt::format("inlet {}: {}", vessels.tree.nodes[static_cast<std::size_t>(inlet)].name,
                    given > 0 ? "nearest to a given root, or else the thickest end"
                              : "the thickest end, since no root was given"));
  if (vessels.hidden_cycles > 0)
    vessels.tree.assumptions.push_back(
        fmt::format("{} tunnels of the mask are no wider than a junction and no loops of the tree",
                    vessels.hidden_cycles));
  return vessels;
}

}  // namespace angiospline
