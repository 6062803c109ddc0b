#include "modeling/network/network_topology.h"

#include <algorithm>

#include "base/disjoint_sets.h"
#include "base/index.h"

namespace angiospline {
namespace {

const KnotVector& knots_along(const Patch& patch, PatchSide side) {
  return side == PatchSide::kU0 || side == PatchSide::kU1 ? patch.v : patch.u;
}

// The counter-clockwise loop runs along v0 and u1, and against v1 and u0.
bool runs_along_loop(PatchSide side) { return side == PatchSide::kV0 || side == PatchSide::kU1; }

bool is_whole(const SurfaceNetwork& network, const Side& side) {
  const KnotVector& knots = knots_along(network.patches[index(side.patch)], side.side);
  return side.from == knots.first() && side.to == knots.last();
}

int degrees_of_freedom(const SurfaceNetwork& network, const Side& side) {
  return knots_along(network.patches[index(side.patch)], side.side).control_point_count();
}

// The side that gives an edge its curve: a whole side before a part, then the one with the fewest
// control points (thesis 3.2), then side a.
NetworkEdge edge_of(const SurfaceNetwork& network, const Join& join) {
  const bool a_whole = is_whole(network, join.a);
  const bool b_whole = is_whole(network, join.b);
  const bool b_first =
      a_whole == b_whole ? degrees_of_freedom(network, join.b) < degrees_of_freedom(network, join.a)
                         : b_whole;
  NetworkEdge edge;
  edge.sides = b_first ? std::array<Side, 2>{join.b, join.a} : std::array<Side, 2>{join.a, join.b};
  edge.reversed = join.reversed;
  return edge;
}

// One use of an edge on a patch's side, with the corners (before they are united) of its ends.
struct SideUse {
  double from = 0.0;
  int edge = -1;
  int use = 0;
  int first_corner = -1;
  int last_corner = -1;
};

struct Corners {
  std::vector<std::array<std::vector<SideUse>, 4>>
      sides;  // by patch and side, in growing parameter
  Points3 positions_mm;
};

// Corner numbers: (0,0), (1,0), (1,1), (0,1) of patch p are 4p .. 4p + 3; T-vertices follow.
constexpr std::array<std::array<int, 2>, 4> kSideCorners{{{0, 3}, {1, 2}, {0, 1}, {3, 2}}};

Corners find_corners(const SurfaceNetwork& network, const std::vector<NetworkEdge>& edges) {
  Corners corners;
  corners.sides.resize(network.patches.size());
  for (std::size_t e = 0; e < edges.size(); ++e) {
    for (int use = 0; use < (edges[e].is_join() ? 2 : 1); ++use) {
      const Side& side = edges[e].sides[index(use)];
      corners.sides[index(side.patch)][static_cast<std::size_t>(side.side)].push_back(
          {side.from, static_cast<int>(e), use, -1, -1});
    }
  }

  // A patch's own corners, counter-clockwise, whoever shares them.
  std::vector<Vec3> positions;
  for (const Patch& patch : network.patches) {
    const int nu = patch.u.control_point_count();
    const int nv = patch.v.control_point_count();
    for (const int k : {0, (nu - 1) * nv, nu * nv - 1, nv - 1}) {
      positions.emplace_back(network.control_points_mm.col(patch.control[index(k)]));
    }
  }

  // Along a side its uses meet head to tail; where two of them do there is a T-vertex.
  for (std::size_t p = 0; p < network.patches.size(); ++p) {
    for (std::size_t s = 0; s < 4; ++s) {
      std::vector<SideUse>& uses = corners.sides[p][s];
      std::sort(uses.begin(), uses.end(),
                [](const SideUse& a, const SideUse& b) { return a.from < b.from; });
      uses.front().first_corner = 4 * static_cast<int>(p) + kSideCorners[s][0];
      uses.back().last_corner = 4 * static_cast<int>(p) + kSideCorners[s][1];
      for (std::size_t k = 1; k < uses.size(); ++k) {
        uses[k - 1].last_corner = uses[k].first_corner = static_cast<int>(positions.size());
        const Vec2 uv =
            side_parameters(network.patches[p], static_cast<PatchSide>(s), uses[k].from);
        positions.push_back(patch_surface(network, static_cast<int>(p)).at(uv.x(), uv.y()));
      }
    }
  }

  corners.positions_mm.resize(3, static_cast<Eigen::Index>(positions.size()));
  for (std::size_t k = 0; k < positions.size(); ++k) {
    corners.positions_mm.col(static_cast<Eigen::Index>(k)) = positions[k];
  }
  return corners;
}

// Unites the corners that edges identify, and gives edges their vertices.
void make_vertices(const Corners& corners, NetworkTopology& topology) {
  std::vector<std::array<std::array<int, 2>, 2>> ends(topology.edges.size());  // [edge][use][end]
  for (const auto& patch : corners.sides) {
    for (const std::vector<SideUse>& side : patch) {
      for (const SideUse& use : side) {
        ends[index(use.edge)][index(use.use)] = {use.first_corner, use.last_corner};
      }
    }
  }
  DisjointSets sets(index(corners.positions_mm.cols()));
  for (std::size_t e = 0; e < ends.size(); ++e) {
    if (!topology.edges[e].is_join()) continue;
    const std::size_t swap = topology.edges[e].reversed ? 1 : 0;
    sets.join(ends[e][0][0], ends[e][1][swap]);
    sets.join(ends[e][0][1], ends[e][1][1 - swap]);
  }

  // A vertex lies at the mean of its corners, and knows how far they are from it.
  const int count = sets.count();
  const std::vector<int> vertex = sets.numbers();
  topology.vertices_mm = Points3::Zero(3, count);
  topology.vertex_gaps_mm.assign(index(count), 0.0);
  Eigen::VectorXd members = Eigen::VectorXd::Zero(count);
  for (std::size_t c = 0; c < vertex.size(); ++c) {
    topology.vertices_mm.col(vertex[c]) += corners.positions_mm.col(static_cast<Eigen::Index>(c));
    members(vertex[c]) += 1;
  }
  topology.vertices_mm.array().rowwise() /= members.transpose().array();
  for (std::size_t c = 0; c < vertex.size(); ++c) {
    const double gap = (topology.vertices_mm.col(vertex[c]) -
                        corners.positions_mm.col(static_cast<Eigen::Index>(c)))
                           .norm();
    double& largest = topology.vertex_gaps_mm[index(vertex[c])];
    largest = std::max(largest, gap);
  }

  for (std::size_t e = 0; e < ends.size(); ++e) {
    topology.edges[e].first_vertex = vertex[index(ends[e][0][0])];
    topology.edges[e].last_vertex = vertex[index(ends[e][0][1])];
  }
}

std::vector<LoopEdge> patch_loop(const std::array<std::vector<SideUse>, 4>& sides,
                                 const std::vector<NetworkEdge>& edges) {
  std::vector<LoopEdge> loop;
  for (const PatchSide side : {PatchSide::kV0, PatchSide::kU1, PatchSide::kV1, PatchSide::kU0}) {
    const bool along = runs_along_loop(side);
    const std::vector<SideUse>& uses = sides[static_cast<std::size_t>(side)];
    for (std::size_t k = 0; k < uses.size(); ++k) {
      const SideUse& use = uses[along ? k : uses.size() - 1 - k];
      const bool with_edge = use.use == 0 || !edges[index(use.edge)].reversed;
      loop.push_back({use.edge, use.use, along == with_edge});
    }
  }
  return loop;
}

std::optional<Error> find_disagreeing_normals(const SurfaceNetwork& network,
                                              const std::vector<NetworkEdge>& edges) {
  for (const NetworkEdge& edge : edges) {
    if (!edge.is_join()) continue;
    const bool first = runs_along_loop(edge.sides[0].side);
    const bool second = runs_along_loop(edge.sides[1].side) != edge.reversed;
    if (first != second) continue;
    const auto name = [&](const Side& side) {
      const Patch& patch = network.patches[index(side.patch)];
      return "patch " + std::to_string(side.patch) + " of " +
             network.regions[index(patch.region)].name;
    };
    return Error{ErrorKind::kBadInput,
                 "normals disagree across a join",
                 name(edge.sides[0]) + " and " + name(edge.sides[1]),
                 {},
                 "every patch's Su x Sv points out of the vessel"};
  }
  return std::nullopt;
}

// The rim's edges in the order and the direction in which the cap's loop runs: against the
// patches'.
Result<std::vector<LoopEdge>> rim_loop(const Rim& rim, int first_edge,
                                       const std::vector<NetworkEdge>& edges) {
  std::vector<LoopEdge> loop;
  for (std::size_t k = 0; k < rim.sides.size(); ++k) {
    loop.push_back({first_edge + static_cast<int>(k), 0, !runs_along_loop(rim.sides[k].side)});
  }

  const auto start = [&](const LoopEdge& e) {
    const NetworkEdge& edge = edges[index(e.edge)];
    return e.forward ? edge.first_vertex : edge.last_vertex;
  };
  const auto end = [&](const LoopEdge& e) {
    const NetworkEdge& edge = edges[index(e.edge)];
    return e.forward ? edge.last_vertex : edge.first_vertex;
  };
  const auto is_closed = [&] {
    for (std::size_t k = 0; k < loop.size(); ++k) {
      if (end(loop[k]) != start(loop[(k + 1) % loop.size()])) return false;
    }
    return true;
  };

  // Sides follow each other around the rim one way or the other.
  if (is_closed()) return loop;
  std::reverse(loop.begin(), loop.end());
  if (is_closed()) return loop;
  return fail({ErrorKind::kBadInput, "rim is not one closed loop", rim.name,
               std::to_string(rim.sides.size()) + " sides",
               "sides follow each other head to tail on one side of the wall"});
}

void find_components(const SurfaceNetwork& network, NetworkTopology& topology) {
  DisjointSets sets(network.patches.size());
  for (const Join& join : network.joins) sets.join(join.a.patch, join.b.patch);
  for (const Rim& rim : network.rims) {
    for (const Side& side : rim.sides) sets.join(side.patch, rim.sides.front().patch);
  }
  topology.components = sets.numbers();
  topology.component_count = sets.count();
}

}  // namespace

double second_parameter(const NetworkEdge& edge, double t) {
  const Side& a = edge.sides[0];
  const Side& b = edge.sides[1];
  const double s = (t - a.from) / (a.to - a.from);
  return edge.reversed ? b.to - s * (b.to - b.from) : b.from + s * (b.to - b.from);
}

Result<NetworkTopology> network_topology(const SurfaceNetwork& network) {
  if (auto error = find_defect(network)) return fail(*std::move(error));

  // An edge for each join, then one for each side of a rim.
  NetworkTopology topology;
  for (const Join& join : network.joins) topology.edges.push_back(edge_of(network, join));
  for (std::size_t r = 0; r < network.rims.size(); ++r) {
    for (const Side& side : network.rims[r].sides) {
      NetworkEdge edge;
      edge.sides[0] = side;
      edge.rim = static_cast<int>(r);
      topology.edges.push_back(edge);
    }
  }
  if (auto error = find_disagreeing_normals(network, topology.edges)) {
    return fail(*std::move(error));
  }

  const Corners corners = find_corners(network, topology.edges);
  make_vertices(corners, topology);
  for (const auto& sides : corners.sides) {
    topology.patch_loops.push_back(patch_loop(sides, topology.edges));
  }

  int first_edge = static_cast<int>(network.joins.size());
  for (const Rim& rim : network.rims) {
    Result<std::vector<LoopEdge>> loop = rim_loop(rim, first_edge, topology.edges);
    if (!loop) return fail(loop.error());
    topology.rim_loops.push_back(*std::move(loop));
    first_edge += static_cast<int>(rim.sides.size());
  }
  find_components(network, topology);
  return topology;
}

}  // namespace angiospline
