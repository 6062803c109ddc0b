#include "recovery/imaging/skeleton/pruning.h"

#include <algorithm>
#include <deque>
#include <set>
#include <tuple>

#include "base/index.h"
#include "recovery/imaging/mask/distance_transform.h"
#include "recovery/imaging/skeleton/thinning.h"

namespace angiospline {
namespace {

// Neighbours follow each other: depth first through the axis.
std::vector<int> walk(const SkeletonLabels& labels) {
  std::vector<int> order;
  order.reserve(labels.voxels.size());
  std::vector<bool> seen(labels.voxels.size(), false);
  std::vector<int> stack;
  for (std::size_t i = 0; i < labels.voxels.size(); ++i) {
    if (seen[i]) continue;
    stack.push_back(static_cast<int>(i));
    while (!stack.empty()) {
      const int at = stack.back();
      stack.pop_back();
      if (seen[index(at)]) continue;
      seen[index(at)] = true;
      order.push_back(at);
      for (const int next : labels.neighbors_of(at))
        if (!seen[index(next)]) stack.push_back(next);
    }
  }
  return order;
}

// The graph while twigs are taken from it. Branches are joined and removed; nodes stay where they
// are.
class Pruner {
 public:
  Pruner(const VesselGraph& graph, const AxisRadii& radii, const PruningOptions& options)
      : graph_(graph),
        radii_(radii),
        options_(options),
        at_(graph.nodes.size()),
        node_radius_mm_(graph.nodes.size(), 0.0) {
    for (std::size_t n = 0; n < graph.nodes.size(); ++n) {
      for (const Voxel& v : graph.nodes[n].cluster) {
        node_radius_mm_[n] = std::max(node_radius_mm_[n], radii.at_mm(v));
        node_voxels_.push_back(graph.grid.offset(v));
      }
    }
    std::sort(node_voxels_.begin(), node_voxels_.end());
    for (const VesselArc& arc : graph.arcs) {
      Branch branch{arc.from, arc.to, {arc.voxels.begin(), arc.voxels.end()}, {}, 0.0, true};
      for (const Voxel& v : arc.voxels)
        branch.radius_mm = std::max(branch.radius_mm, radii.at_mm(v));
      add(std::move(branch));
    }
  }

  // Voxels of all twigs.
  std::vector<Voxel> prune() {
    std::vector<Voxel> cut;
    while (!waiting_.empty()) {
      const auto [reach, end, number] = *waiting_.begin();
      waiting_.erase(waiting_.begin());
      const Branch& branch = branches_[number];
      if (!branch.alive || !is_terminal(branch)) continue;
      const int junction = junction_of(branch);
      // Clusters that stay are not cut; those that became part of the branch are.
      for (const Voxel& v : branch.voxels)
        if (!is_in_node(v)) cut.push_back(v);
      cut.push_back(end_voxel(branch));
      for (const int n : branch.swallowed) {
        const std::vector<Voxel>& cluster = graph_.nodes[index(n)].cluster;
        cut.insert(cut.end(), cluster.begin(), cluster.end());
      }
      ++twigs_;
      remove(number);
      join_at(junction);
    }
    return cut;
  }

  int twigs() const { return twigs_; }

  // Ends that were not cut off: nodes that still have a branch, or never had one.
  std::vector<std::size_t> kept_ends() const {
    std::vector<std::size_t> ends;
    for (std::size_t n = 0; n < at_.size(); ++n)
      if (graph_.nodes[n].arcs.empty() || (graph_.nodes[n].is_end() && !at_[n].empty()))
        ends.push_back(graph_.grid.offset(graph_.nodes[n].voxel));
    return ends;
  }

 private:
  struct Branch {
    int from, to;
    std::deque<Voxel> voxels;
    std::deque<int> swallowed;  // junctions that became part of the branch
    double radius_mm;           // the largest along it
    bool alive;
  };

  bool is_in_node(const Voxel& v) const {
    return std::binary_search(node_voxels_.begin(), node_voxels_.end(), graph_.grid.offset(v));
  }

  const Voxel& end_voxel(const Branch& b) const {
    return graph_.nodes[index(is_end(b.from) ? b.from : b.to)].voxel;
  }

  bool is_end(int node) const {
    const VesselNode& n = graph_.nodes[index(node)];
    return n.is_end() && n.cluster.size() == 1;
  }

  bool is_terminal(const Branch& b) const {
    return is_end(b.from) != is_end(b.to) && at_[index(junction_of(b))].size() >= 3;
  }

  int junction_of(const Branch& b) const { return is_end(b.from) ? b.to : b.from; }

  void add(Branch branch) {
    const std::size_t number = branches_.size();
    at_[index(branch.from)].push_back(number);
    at_[index(branch.to)].push_back(number);
    branches_.push_back(std::move(branch));
    judge(number);
  }

  // Puts a branch that is a twig by the rule into the queue. A junction only loses branches, so
  // what is not terminal now may be so only after a join, which makes a new branch.
  void judge(std::size_t number) {
    const Branch& b = branches_[number];
    if (is_end(b.from) == is_end(b.to)) return;

    const int junction = junction_of(b);
    const ImageGrid& grid = graph_.grid;
    const Vec3 center = grid.world_mm(graph_.nodes[index(junction)].voxel);
    const double lumen = node_radius_mm_[index(junction)];
    const double voxel = options_.voxels * grid.spacing_mm.maxCoeff();
    const Voxel& end = end_voxel(b);

    // A branch whose end alone reaches far enough need not be looked at voxel by voxel.
    const double most = std::max(options_.radii, options_.corner_radii);
    if ((grid.world_mm(end) - center).norm() - lumen > most * b.radius_mm + voxel) return;

    double reach = 0.0;
    double radius = 0.0;
    double sum = 0.0;
    int outside = 0;
    for (const Voxel& v : b.voxels) {
      const double r = radii_.at_mm(v);
      const double distance = (grid.world_mm(v) - center).norm();
      reach = std::max(reach, distance + r - lumen);
      if (distance <= lumen) continue;
      ++outside;
      sum += r;
      radius = std::max(radius, r);
    }

    const bool is_short = reach < options_.radii * radius + voxel;
    const bool is_corner = sum < options_.corner_fullness * radius * outside &&
                           reach < options_.corner_radii * radius + voxel;
    if (outside > 0 && !is_short && !is_corner) return;
    waiting_.insert({reach, grid.offset(end), number});
  }

  void remove(std::size_t number) {
    Branch& b = branches_[number];
    b.alive = false;
    for (const int n : {b.from, b.to}) std::erase(at_[index(n)], number);
  }

  // A junction left with two branches becomes part of one.
  void join_at(int node) {
    const VesselNode& junction = graph_.nodes[index(node)];
    if (at_[index(node)].size() != 2 || junction.cluster_cycles + junction.cluster_cavities > 0)
      return;

    const std::size_t first = at_[index(node)][0];
    const std::size_t second = at_[index(node)][1];
    if (first == second) return;

    Branch a = std::move(branches_[first]);
    Branch b = std::move(branches_[second]);
    branches_[first] = Branch{a.from, a.to, {}, {}, 0.0, true};
    branches_[second] = Branch{b.from, b.to, {}, {}, 0.0, true};
    remove(first);
    remove(second);

    if (a.voxels.size() < b.voxels.size()) std::swap(a, b);  // the shorter is added to the longer
    const int far = b.from == node ? b.to : b.from;
    if (b.from != node) std::reverse(b.voxels.begin(), b.voxels.end());
    if (a.to == node) {
      a.voxels.insert(a.voxels.end(), b.voxels.begin() + 1, b.voxels.end());
      a.to = far;
    } else {
      a.voxels.insert(a.voxels.begin(), b.voxels.rbegin(), b.voxels.rend() - 1);
      a.from = far;
    }

    if (a.swallowed.size() < b.swallowed.size()) std::swap(a.swallowed, b.swallowed);
    a.swallowed.insert(a.swallowed.end(), b.swallowed.begin(), b.swallowed.end());
    a.swallowed.push_back(node);
    a.radius_mm = std::max(a.radius_mm, b.radius_mm);
    add(std::move(a));
  }

  const VesselGraph& graph_;
  const AxisRadii& radii_;
  const PruningOptions& options_;
  std::vector<std::vector<std::size_t>>
      at_;  // living branches at each node; a loop is listed twice
  std::vector<double> node_radius_mm_;
  std::vector<std::size_t> node_voxels_;  // offsets of all nodes' voxels
  std::vector<Branch> branches_;
  std::set<std::tuple<double, std::size_t, std::size_t>> waiting_;  // reach, end voxel, branch
  int twigs_ = 0;
};

}  // namespace

AxisRadii::AxisRadii(const Mask& mask, const SkeletonLabels& labels)
    : grid_(labels.grid), offsets_(labels.voxels), radii_mm_(labels.voxels.size()) {
  const std::vector<int> order = walk(labels);
  std::vector<std::size_t> places;
  places.reserve(order.size());
  for (const int i : order) places.push_back(offsets_[index(i)]);
  const std::vector<double> distances = boundary_distances_mm(mask, places);
  for (std::size_t k = 0; k < order.size(); ++k) radii_mm_[index(order[k])] = distances[k];
}

double AxisRadii::at_mm(const Voxel& voxel) const {
  const std::size_t offset = grid_.offset(voxel);
  const auto at = std::lower_bound(offsets_.begin(), offsets_.end(), offset);
  EXPECTS(at != offsets_.end() && *at == offset);
  return radii_mm_[static_cast<std::size_t>(at - offsets_.begin())];
}

Result<PrunedSkeleton> prune_twigs(const Mask& mask, Mask skeleton, const PruningOptions& options,
                                   const Progress& progress) {
  EXPECTS(mask.grid.size == skeleton.grid.size);
  PrunedSkeleton result;
  result.skeleton = std::move(skeleton);
  for (std::uint8_t& v : result.skeleton.voxels) v = v != 0 ? 1 : 0;

  SkeletonLabels labels = label_skeleton(result.skeleton, options.connectivity);
  const AxisRadii radii(mask, labels);

  for (;;) {
    if (progress.should_stop()) return fail(cancelled("prune"));
    ++result.rounds;
    result.graph = vessel_graph(labels);
    Pruner pruner(result.graph, radii, options);
    const std::vector<Voxel> cut = pruner.prune();
    if (pruner.twigs() == 0) return result;
    result.twigs += pruner.twigs();

    for (const Voxel& v : cut) result.skeleton[v] = 0;
    rethin(result.skeleton, labels.voxels, pruner.kept_ends(), options.connectivity);
    std::vector<std::size_t> left;
    for (const std::size_t offset : labels.voxels)
      if (result.skeleton.voxels[offset] != 0) left.push_back(offset);
    labels = label_skeleton(result.skeleton, std::move(left), options.connectivity);
  }
}

}  // namespace angiospline
