#include "recovery/centerlines/vessels_from_mask.h"

#include <algorithm>

#include <fmt/format.h>

#include "base/index.h"
#include "recovery/centerlines/rules.h"
#include "recovery/imaging/skeleton/contacts.h"
#include "recovery/imaging/skeleton/junction_merging.h"

namespace angiospline {
namespace {

using namespace centerline_rules;

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
  options.skeleton.reset();
  Parted out{mask, {}, 0};
  for (int k = 0; k < kPartings && !contacts.empty(); ++k) {
    out.cut += static_cast<int>(contacts.size());
    out.mask = cut_contacts(std::move(out.mask), contacts);
    Result<PrunedSkeleton> axis = pruned_axis(out.mask, options, progress);
    if (!axis) return fail(axis.error());
    out.axis = std::move(*axis);
    contacts = find_contacts(out.axis.graph, out.mask);
  }
  return out;
}

// The first root in a component rules: given ones come first, then the thickest ends.
std::vector<int> roots_of(const VesselGraph& graph, const Mask& mask,
                          const std::vector<Vec3>& given_mm) {
  std::vector<int> roots;
  for (const Vec3& root : given_mm) roots.push_back(nearest_node(graph, root));
  for (const int n : thickest_ends(graph, mask)) roots.push_back(n);
  return roots;
}

// Masks without a vessel, or without a background.
std::optional<Error> find_defect(const Mask& mask, const TopologyNumbers& numbers) {
  if (numbers.components == 0) {
    return Error{
        ErrorKind::kBadInput, "mask is empty", {}, {}, "at least one voxel must be foreground"};
  }
  if (std::find(mask.voxels.begin(), mask.voxels.end(), 0) == mask.voxels.end()) {
    return Error{ErrorKind::kBadInput,
                 "mask is full",
                 {},
                 "no voxel is background",
                 "a vessel has a wall within the image"};
  }
  return std::nullopt;
}

// Says in the tree what was taken for granted on the way to it.
void name_assumptions(Vessels& vessels, bool roots_given) {
  CenterlineTree& tree = vessels.tree;
  for (const int inlet : tree.inlets) {
    tree.assumptions.push_back(fmt::format("inlet {}: {}", tree.nodes[index(inlet)].name,
                                           roots_given
                                               ? "nearest to a given root, or else the thickest end"
                                               : "the thickest end, since no root was given"));
  }

  for (const MaskContact& contact : vessels.contacts) {
    tree.assumptions.push_back(contact_text(contact) +
                               (vessels.contacts_cut > 0 ? "; cut" : "; taken as joined"));
  }

  if (vessels.hidden_cycles > 0) {
    tree.assumptions.push_back(
        fmt::format("{} tunnels of the mask are no wider than a junction and no loops of the tree",
                    vessels.hidden_cycles));
  }
}

}  // namespace

Result<Vessels> vessels_from_mask(const Mask& given, const VesselsOptions& options,
                                  const Progress& progress) {
  Vessels vessels;
  const Connectivity connectivity = options.thinning.connectivity;
  vessels.before = topology_numbers(given, connectivity);
  if (const auto defect = find_defect(given, vessels.before)) return fail(*defect);

  // The axis, and the mask that it belongs to: contacts are cut in the mask, not in the axis.
  Result<PrunedSkeleton> pruned = pruned_axis(given, options, progress);
  if (!pruned) return fail(pruned.error());
  vessels.contacts = find_contacts(pruned->graph, given);
  Mask cut_mask;
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

  // The graph, rooted where flow enters.
  const VesselGraph graph = merge_close_junctions(pruned->graph, mask, options.merge_radii);
  vessels.merged = static_cast<int>(pruned->graph.nodes.size() - graph.nodes.size());
  for (const VesselNode& node : graph.nodes) vessels.hidden_cycles += node.cluster_cycles;
  vessels.graph = rooted_at(graph, roots_of(graph, mask, options.roots_mm));

  Result<CenterlineTree> tree =
      centerlines_from_graph(vessels.graph, mask, options.centerlines, progress);
  if (!tree) return fail(tree.error());
  vessels.tree = std::move(*tree);
  name_assumptions(vessels, !options.roots_mm.empty());
  return vessels;
}

}  // namespace angiospline
