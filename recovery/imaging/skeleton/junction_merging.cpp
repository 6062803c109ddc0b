#include "recovery/imaging/skeleton/junction_merging.h"

#include <algorithm>
#include <map>
#include <tuple>

#include "base/index.h"
#include "recovery/imaging/mask/distance_transform.h"

namespace angiospline {
namespace {

// The way without the detours that come back to a voxel already passed.
std::vector<Voxel> without_returns(const std::vector<Voxel>& way, bool closed) {
  std::vector<Voxel> straight;
  std::map<Voxel, std::size_t> at;
  for (std::size_t i = 0; i < way.size(); ++i) {
    const bool closes = closed && i + 1 == way.size();  // a loop does come back to its node
    const auto seen = at.find(way[i]);
    if (seen != at.end() && !closes) {
      for (std::size_t k = seen->second + 1; k < straight.size(); ++k) at.erase(straight[k]);
      straight.resize(seen->second + 1);
      continue;
    }
    at[way[i]] = straight.size();
    straight.push_back(way[i]);
  }
  return straight;
}

class Merger {
 public:
  Merger(const VesselGraph& graph, const Mask& mask)
      : graph_(graph), gone_(graph.arcs.size(), false) {
    std::vector<std::size_t> places;
    for (const VesselNode& node : graph.nodes) places.push_back(graph.grid.offset(node.voxel));
    lumen_mm_ = boundary_distances_mm(mask, places);
    for (std::size_t n = 0; n < graph.nodes.size(); ++n) owner_.push_back(static_cast<int>(n));
  }

  void merge(double radii) {
    std::vector<std::tuple<double, std::size_t>> close;
    for (std::size_t a = 0; a < graph_.arcs.size(); ++a) {
      const auto [from, to] = std::pair(graph_.arcs[a].from, graph_.arcs[a].to);
      if (from == to || !is_junction(from) || !is_junction(to)) continue;
      const double length = (position(from) - position(to)).norm();
      if (length < radii * std::max(lumen_mm_[index(from)], lumen_mm_[index(to)]))
        close.emplace_back(length, a);
    }
    std::sort(close.begin(), close.end());
    for (const auto& [length, a] : close) contract(a);
  }

  VesselGraph take() {
    VesselGraph out;
    out.grid = graph_.grid;
    std::vector<int> number(graph_.nodes.size(), -1);
    for (std::size_t n = 0; n < graph_.nodes.size(); ++n) {
      if (owner_[n] != static_cast<int>(n)) continue;
      number[n] = static_cast<int>(out.nodes.size());
      out.nodes.push_back(graph_.nodes[n]);
      out.nodes.back().arcs.clear();
    }

    for (std::size_t a = 0; a < graph_.arcs.size(); ++a) {
      if (gone_[a]) continue;
      VesselArc arc = std::move(graph_.arcs[a]);
      arc.from = number[index(arc.from)];
      arc.to = number[index(arc.to)];
      const auto i = static_cast<int>(out.arcs.size());
      out.nodes[index(arc.from)].arcs.push_back(i);
      out.nodes[index(arc.to)].arcs.push_back(i);
      out.arcs.push_back(std::move(arc));
    }

    std::vector<int> roots;  // the first node of each component, or what took it in
    for (std::size_t n = 0; n < graph_.nodes.size(); ++n)
      if (n == 0 || graph_.nodes[n].component != graph_.nodes[n - 1].component)
        roots.push_back(number[index(owner_of(static_cast<int>(n)))]);
    return rooted_at(out, roots);
  }

 private:
  bool is_junction(int n) const { return graph_.nodes[index(n)].arcs.size() > 2; }
  Vec3 position(int n) const { return graph_.grid.world_mm(graph_.nodes[index(n)].voxel); }

  int owner_of(int n) {
    while (owner_[index(n)] != n) n = owner_[index(n)] = owner_[index(owner_[index(n)])];
    return n;
  }

  // The arc's ends have become one already if a shorter arc ran beside it: it is a loop then and
  // stays.
  void contract(std::size_t a) {
    VesselArc& bridge = graph_.arcs[a];
    if (bridge.from == bridge.to) return;
    const bool from_stays = lumen_mm_[index(bridge.from)] >= lumen_mm_[index(bridge.to)];
    const int stays = from_stays ? bridge.from : bridge.to;
    const int goes = from_stays ? bridge.to : bridge.from;
    std::vector<Voxel> way = bridge.voxels;  // from the node that stays to the one that goes
    if (!from_stays) std::reverse(way.begin(), way.end());

    gone_[a] = true;
    VesselNode& keeper = graph_.nodes[index(stays)];
    VesselNode& guest = graph_.nodes[index(goes)];
    std::erase(keeper.arcs, static_cast<int>(a));
    std::erase(guest.arcs, static_cast<int>(a));

    std::vector<int> moved = guest.arcs;
    std::sort(moved.begin(), moved.end());
    moved.erase(std::unique(moved.begin(), moved.end()), moved.end());
    for (const int m : moved) lead_on(graph_.arcs[index(m)], goes, stays, way);

    keeper.arcs.insert(keeper.arcs.end(), guest.arcs.begin(), guest.arcs.end());
    keeper.cluster.insert(keeper.cluster.end(), guest.cluster.begin(), guest.cluster.end());
    keeper.cluster.insert(keeper.cluster.end(), way.begin(), way.end());
    std::sort(keeper.cluster.begin(), keeper.cluster.end());
    keeper.cluster.erase(std::unique(keeper.cluster.begin(), keeper.cluster.end()),
                         keeper.cluster.end());
    keeper.cluster_cycles += guest.cluster_cycles;
    keeper.cluster_cavities += guest.cluster_cavities;

    owner_[index(goes)] = stays;
  }

  static void lead_on(VesselArc& arc, int goes, int stays, const std::vector<Voxel>& way) {
    std::vector<Voxel> voxels;
    if (arc.from == goes) voxels.insert(voxels.end(), way.begin(), way.end() - 1);
    voxels.insert(voxels.end(), arc.voxels.begin(), arc.voxels.end());
    if (arc.to == goes) voxels.insert(voxels.end(), way.rbegin() + 1, way.rend());
    if (arc.from == goes) arc.from = stays;
    if (arc.to == goes) arc.to = stays;
    arc.voxels = without_returns(voxels, arc.from == arc.to);
  }

  VesselGraph graph_;
  std::vector<bool> gone_;
  std::vector<int> owner_;
  std::vector<double> lumen_mm_;
};

}  // namespace

VesselGraph merge_close_junctions(const VesselGraph& graph, const Mask& mask, double radii) {
  EXPECTS(graph.grid.size == mask.grid.size);
  Merger merger(graph, mask);
  merger.merge(radii);
  return merger.take();
}

}  // namespace angiospline
