#include "recovery/centerlines/branch_points.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "base/index.h"
#include "recovery/centerlines/rules.h"
#include "recovery/imaging/skeleton/pruning.h"

namespace angiospline {
namespace {

using namespace centerline_rules;

// The graph's voxels as labels know them, for their distances.
SkeletonLabels label_of_graph(const VesselGraph& graph, const Mask& mask) {
  std::vector<std::size_t> offsets;
  for (const VesselNode& node : graph.nodes)
    for (const Voxel& v : node.cluster) offsets.push_back(graph.grid.offset(v));
  for (const VesselArc& arc : graph.arcs)
    for (const Voxel& v : arc.voxels) offsets.push_back(graph.grid.offset(v));
  std::sort(offsets.begin(), offsets.end());
  offsets.erase(std::unique(offsets.begin(), offsets.end()), offsets.end());
  return label_skeleton(mask, std::move(offsets));
}

// The part [begin, end) of an arc's voxels without the tails that thinning may have bent into a
// corner of a free end: a corner of a flat end is sqrt(2) radii from the nearest place that is a
// radius away from all walls. At least a fifth of the arc is kept.
std::pair<std::size_t, std::size_t> kept_part(const VesselGraph& graph, const VesselArc& arc,
                                              const AxisRadii& radii) {
  const std::size_t count = arc.voxels.size();
  const double voxel_mm = graph.grid.spacing_mm.maxCoeff();

  // The last voxel within a corner's reach of the tip; a look farther tells whether there is one.
  const auto tail = [&](bool at_front, std::size_t most) {
    const auto voxel = [&](std::size_t i) { return arc.voxels[at_front ? i : count - 1 - i]; };
    const Vec3 tip = graph.grid.world_mm(voxel(0));
    double radius = 0.0;
    std::size_t bent = 0;
    for (std::size_t i = 0; i <= most; ++i) {
      radius = std::max(radius, radii.at_mm(voxel(i)));
      const double distance = (graph.grid.world_mm(voxel(i)) - tip).norm();
      if (distance < kTail.radii * radius + kTail.voxels * voxel_mm) bent = i;
      // In a corner the radius grows faster.
      if (distance > kTail.farthest_radii * radius + kTail.farthest_voxels * voxel_mm) break;
    }
    return bent;
  };

  const bool free_from = graph.nodes[index(arc.from)].is_end();
  const bool free_to = graph.nodes[index(arc.to)].is_end();
  const std::size_t most = (count - 1) * 2 / (free_from && free_to ? 5 : 3);
  return {free_from ? tail(true, most) : 0, count - (free_to ? tail(false, most) : 0)};
}

// Points nearer to a junction's node than its widest place is to the wall.
std::vector<bool> in_junctions(const VesselGraph& graph, const BranchPoints& points,
                               const AxisRadii& radii) {
  std::vector<bool> in_junction(index(points.at_mm.cols()), false);
  for (std::size_t n = 0; n < graph.nodes.size(); ++n) {
    const VesselNode& node = graph.nodes[n];
    if (node.arcs.size() < 3) continue;
    double lumen = 0.0;
    for (const Voxel& v : node.cluster) lumen = std::max(lumen, radii.at_mm(v));

    const Vec3 center = points.voxels_mm.col(static_cast<int>(n));
    for (const int a : node.arcs) {
      for (const int u : points.chains[index(a)].unknowns) {
        if ((points.voxels_mm.col(u) - center).norm() < lumen) in_junction[index(u)] = true;
      }
    }
  }
  return in_junction;
}

}  // namespace

BranchPoints branch_points(const VesselGraph& graph, const Mask& mask, TipRule tips) {
  const AxisRadii radii(mask, label_of_graph(graph, mask));
  BranchPoints points;
  std::vector<Voxel> voxels;
  for (const VesselNode& node : graph.nodes) voxels.push_back(node.voxel);

  // Chains in the order of the arcs: their ends are the nodes' unknowns, which branches share.
  for (const VesselArc& arc : graph.arcs) {
    SmoothingChain chain;
    const auto [begin, end] = tips == TipRule::kSkeleton
                                  ? std::pair(std::size_t{0}, arc.voxels.size())
                                  : kept_part(graph, arc, radii);
    const bool free_from = graph.nodes[index(arc.from)].is_end();
    const bool free_to = graph.nodes[index(arc.to)].is_end();
    for (std::size_t i = begin; i < end; ++i) {
      const bool first = i == begin, last = i + 1 == end;
      if (first && !free_from) {
        chain.unknowns.push_back(arc.from);
      } else if (last && !free_to) {
        chain.unknowns.push_back(arc.to);
      } else if (first || last) {  // a free end, perhaps cut back: its node is here now
        const int node = first ? arc.from : arc.to;
        voxels[index(node)] = arc.voxels[i];
        chain.unknowns.push_back(node);
      } else {
        chain.unknowns.push_back(static_cast<int>(voxels.size()));
        voxels.push_back(arc.voxels[i]);
      }
    }
    points.chains.push_back(std::move(chain));
  }

  const Eigen::Index n = std::ssize(voxels);
  points.voxels_mm.resize(3, n);
  points.inscribed_mm.resize(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    points.voxels_mm.col(i) = graph.grid.world_mm(voxels[index(i)]);
    points.inscribed_mm[i] =
        std::max(radii.at_mm(voxels[index(i)]), 0.5 * graph.grid.spacing_mm.minCoeff());
  }
  points.at_mm = points.voxels_mm;
  points.radius_mm = Eigen::VectorXd::Zero(n);
  points.in_junction = in_junctions(graph, points, radii);
  return points;
}

std::vector<SmoothingChain> solver_chains(const VesselGraph& graph, const BranchPoints& points) {
  std::vector<SmoothingChain> chains = points.chains;
  for (std::size_t a = 0; a < chains.size(); ++a) {
    const VesselArc& arc = graph.arcs[a];
    std::vector<int>& u = chains[a].unknowns;
    if (arc.from == arc.to && graph.nodes[index(arc.from)].arcs.size() == 2 && u.size() > 3)
      u.push_back(u[1]);
  }
  return chains;
}

Points3 branch_tangents(const VesselGraph& graph, const BranchPoints& points) {
  Points3 t = Points3::Zero(3, points.at_mm.cols());
  for (const SmoothingChain& chain : solver_chains(graph, points)) {
    const std::vector<int>& u = chain.unknowns;
    for (std::size_t i = 0; i < u.size(); ++i) {
      const int before = u[i == 0 ? 0 : i - 1];
      const int after = u[i + 1 == u.size() ? i : i + 1];
      const Vec3 d = points.at_mm.col(after) - points.at_mm.col(before);
      if (d.norm() > 0.0) t.col(u[i]) = d.normalized();
    }
  }
  return t;
}

std::vector<bool> clear_of_junctions(const BranchPoints& points, const Eigen::VectorXd& reach_mm) {
  std::vector<bool> clear(points.in_junction.size(), true);
  for (const SmoothingChain& chain : points.chains) {
    const std::vector<int>& u = chain.unknowns;

    // From either end: the way since the last point within a junction.
    for (const bool forward : {true, false}) {
      double since = std::numeric_limits<double>::infinity();
      for (std::size_t k = 0; k < u.size(); ++k) {
        const int i = u[forward ? k : u.size() - 1 - k];
        if (k > 0)
          since +=
              (points.at_mm.col(i) - points.at_mm.col(u[forward ? k - 1 : u.size() - k])).norm();
        if (points.in_junction[index(i)]) since = 0.0;
        if (since < reach_mm(i)) clear[index(i)] = false;
      }
    }
  }
  return clear;
}

}  // namespace angiospline
