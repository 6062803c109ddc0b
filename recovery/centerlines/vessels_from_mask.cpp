#include "recovery/centerlines/vessels_from_mask.h"

#include <algorithm>

#include <fmt/format.h>

#include "recovery/imaging/skeleton/contacts.h"
#include "recovery/imaging/skeleton/junction_merging.h"

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

namespace {

// What was found to touch, in words.
std::string contact_text(const MaskContact& contact) {
  return fmt::format(
      "{} at ({:.4g}, {:.4g}, {:.4g}) mm: radii {:.3g} and {:.3g} mm, axes {:.3g} mm apart",
      words_for(contact.kind), contact.at_mm.x(), contact.at_mm.y(), contact.at_mm.z(),
      contact.a.radius_mm, contact.b.radius_mm, contact.distance_mm);
}

// The pruned axis of the mask with its contacts cut; cutting may bring others to light.
struct Parted {
  Mask mask;
  PrunedSkeleton axis;
  int cut = 0;
};

Result<Parted> parted(const Mask& mask, VesselsOptions options, std::vector<MaskContact> contacts,
                      const Progress& progress) {
  constexpr int kRounds = 4;
  options.skeleton.reset();
  Parted out{mask, {}, 0};
  for (int k = 0; k < kRounds && !contacts.empty(); ++k) {
    out.cut += static_cast<int>(contacts.size());
    out.mask = cut_contacts(std::move(out.mask), contacts);
    Result<PrunedSkeleton> axis = pruned_axis(out.mask, options, progress);
    if (!axis) return fail(axis.error());
    out.axis = std::move(*axis);
    contacts = find_contacts(out.axis.graph, out.mask);
  }
  return out;
}

}  // namespace

Result<Vessels> vessels_from_mask(const Mask& given, const VesselsOptions& options,
                                  const Progress& progress) {
  Vessels vessels;
  Mask cut_mask;
  const Connectivity connectivity = options.thinning.connectivity;
  vessels.before = topology_numbers(given, connectivity);
  if (vessels.before.components == 0)
    return fail(
        {ErrorKind::kBadInput, "mask is empty", {}, {}, "at least one voxel must be foreground"});
  if (std::find(given.voxels.begin(), given.voxels.end(), 0) == given.voxels.end())
    return fail({ErrorKind::kBadInput,
                 "mask is full",
                 {},
                 "no voxel is background",
                 "a vessel has a wall within the image"});
  Result<PrunedSkeleton> pruned = pruned_axis(given, options, progress);
  if (!pruned) return fail(pruned.error());
  vessels.contacts = find_contacts(pruned->graph, given);
  if (options.cut_contacts && !vessels.contacts.empty()) {
    Result<Parted> apart = parted(given, options, vessels.contacts, progress);
    if (!apart) return fail(apart.error());
    cut_mask = std::move(apart->mask);
    pruned = std::move(apart->axis);
    vessels.contacts_cut = apart->cut;
  }
  const Mask& mask = vessels.contacts_cut > 0 ? cut_mask : given;
  vessels.skeleton = std::move(pruned->skeleton);
  vessels.twigs = pruned->twigs;
  vessels.after = topology_numbers(vessels.skeleton, connectivity);
  const VesselGraph graph = merge_close_junctions(pruned->graph, mask, options.merge_radii);
  vessels.merged = static_cast<int>(pruned->graph.nodes.size() - graph.nodes.size());
  for (const VesselNode& node : graph.nodes) vessels.hidden_cycles += node.cluster_cycles;
  std::vector<int> roots;
  for (const Vec3& root : options.roots_mm) roots.push_back(nearest_node(graph, root));
  const std::size_t given_roots = roots.size();
  for (const int n : thickest_ends(graph, mask)) roots.push_back(n);
  vessels.graph = rooted_at(graph, roots);  // the first root in a component rules: the given one
  Result<CenterlineTree> tree =
      centerlines_from_graph(vessels.graph, mask, options.centerlines, progress);
  if (!tree) return fail(tree.error());
  vessels.tree = std::move(*tree);
  for (const int inlet : vessels.tree.inlets)
    vessels.tree.assumptions.push_back(
        fmt::format("inlet {}: {}", vessels.tree.nodes[static_cast<std::size_t>(inlet)].name,
                    given_roots > 0 ? "nearest to a given root, or else the thickest end"
                                    : "the thickest end, since no root was given"));
  for (const MaskContact& contact : vessels.contacts)
    vessels.tree.assumptions.push_back(contact_text(contact) +
                                       (vessels.contacts_cut > 0 ? "; cut" : "; taken as joined"));
  if (vessels.hidden_cycles > 0)
    vessels.tree.assumptions.push_back(
        fmt::format("{} tunnels of the mask are no wider than a junction and no loops of the tree",
                    vessels.hidden_cycles));
  return vessels;
}

}  // namespace angiospline
