#include "modeling/network/tessellation_edges.h"

#include <algorithm>

#include "base/disjoint_sets.h"
#include "base/index.h"
#include "modeling/network/rules.h"

namespace angiospline {
namespace {

// Along these sides a patch's boundary is run counter-clockwise in growing parameter.
bool runs_forward(PatchSide side) { return side == PatchSide::kV0 || side == PatchSide::kU1; }

// Directed segments as one loop, from the segment that was found first.
std::vector<int> closed_chain(std::vector<std::array<int, 2>> segments) {
  const int start = segments.front()[0];
  std::sort(segments.begin(), segments.end());

  std::vector<int> loop;
  int point = start;
  do {
    loop.push_back(point);
    const auto next = std::lower_bound(segments.begin(), segments.end(), std::array{point, -1});
    point = (*next)[1];
  } while (point != start && loop.size() < segments.size());
  return loop;
}

}  // namespace

TessellationEdges::TessellationEdges(const SurfaceNetwork& network,
                                     const std::vector<BSplineSurface<3>>& surfaces,
                                     const std::vector<PatchSpacing>& spacings,
                                     TessellationDraft& draft)
    : network_(network), surfaces_(surfaces), spacings_(spacings), draft_(draft) {
  collect();
  number_corners();
  for (Edge& edge : edges_) sample(edge);
}

void TessellationEdges::use(const Side& side, int edge, bool is_b) {
  uses_[index(side.patch)][static_cast<std::size_t>(side.side)].push_back({edge, is_b, side.from});
}

void TessellationEdges::collect() {
  uses_.resize(network_.patches.size());
  for (const Join& join : network_.joins) {
    use(join.a, static_cast<int>(edges_.size()), false);
    use(join.b, static_cast<int>(edges_.size()), true);
    edges_.push_back({join, -1, {}, {}});
  }
  for (std::size_t r = 0; r < network_.rims.size(); ++r) {
    for (const Side& side : network_.rims[r].sides) {
      use(side, static_cast<int>(edges_.size()), false);
      edges_.push_back({{side, side, false}, static_cast<int>(r), {}, {}});
    }
  }

  // Several edges may share a side, part by part.
  for (auto& sides : uses_) {
    for (auto& uses : sides) {
      std::sort(uses.begin(), uses.end(),
                [](const Use& a, const Use& b) { return a.from < b.from; });
    }
  }
}

// Ends of edges are identified by combinatorics alone: neighbours on a side, sides at a corner of
// a patch, and the two sides of a join. Distances play no part, so no gap can open.
void TessellationEdges::number_corners() {
  DisjointSets ends(2 * edges_.size());  // end 2 e + (0 start, 1 end) of edge e

  // The end of a use at the low (0) or high (1) parameter of the patch's side.
  const auto end_of = [&](const Use& u, int high) {
    const bool flip = u.is_b && edges_[index(u.edge)].join.reversed;
    return 2 * u.edge + (flip ? 1 - high : high);
  };

  for (const auto& sides : uses_) {
    for (const auto& uses : sides) {
      for (std::size_t k = 1; k < uses.size(); ++k)
        ends.join(end_of(uses[k - 1], 1), end_of(uses[k], 0));
    }
    const auto& [u0, u1, v0, v1] = sides;
    ends.join(end_of(u0.front(), 0), end_of(v0.front(), 0));
    ends.join(end_of(u0.back(), 1), end_of(v1.front(), 0));
    ends.join(end_of(u1.front(), 0), end_of(v0.back(), 1));
    ends.join(end_of(u1.back(), 1), end_of(v1.back(), 1));
  }

  // A point for each class of ends, where the first of its edges has it.
  std::vector<int> number(ends.size(), -1);
  for (std::size_t e = 0; e < edges_.size(); ++e) {
    const Side& side = edges_[e].join.a;
    edges_[e].points.resize(2);
    for (const int end : {0, 1}) {
      int& n = number[index(ends.root(2 * static_cast<int>(e) + end))];
      if (n < 0) n = add_point(side, end == 0 ? side.from : side.to);
      edges_[e].points[index(end)] = n;
    }
  }
}

int TessellationEdges::add_point(const Side& side, double t) {
  const Vec2 uv = side_parameters(network_.patches[index(side.patch)], side.side, t);
  return draft_.add_point({side.patch, uv}, surfaces_[index(side.patch)].at(uv.x(), uv.y()));
}

// Divides an edge by the larger density of its two sides.
void TessellationEdges::sample(Edge& edge) {
  const Side& a = edge.join.a;
  const Side& b = edge.join.b;
  const Density& da = density_along(spacings_[index(a.patch)], a.side);
  const Density& db = density_along(spacings_[index(b.patch)], b.side);
  const std::size_t steps = 2 * std::max(da.parameters.size(), db.parameters.size());
  std::vector<double> density;
  for (std::size_t k = 0; k <= steps; ++k) {
    const double s = static_cast<double>(k) / static_cast<double>(steps);
    density.push_back(std::max(da(join_parameter_a(edge.join, s)) * (a.to - a.from),
                               db(join_parameter_b(edge.join, s)) * (b.to - b.from)));
  }
  edge.along = equidistribute(density, network_rules::kLeastEdgeSegments);

  // New points between the edge's two corners.
  const int last = edge.points.back();
  edge.points.pop_back();
  for (std::size_t k = 1; k + 1 < edge.along.size(); ++k) {
    edge.points.push_back(add_point(a, join_parameter_a(edge.join, edge.along[k])));
  }
  edge.points.push_back(last);
}

MeshChain TessellationEdges::side_chain(int patch, PatchSide side) const {
  MeshChain chain;
  for (const Use& u : uses_[index(patch)][static_cast<std::size_t>(side)]) {
    const Edge& edge = edges_[index(u.edge)];
    const std::size_t n = edge.along.size();
    const bool flip = u.is_b && edge.join.reversed;
    for (std::size_t k = 0; k < n; ++k) {
      const std::size_t i = flip ? n - 1 - k : k;
      if (k == 0 && !chain.points.empty()) continue;  // the end of the edge before
      chain.push(u.is_b ? join_parameter_b(edge.join, edge.along[i])
                        : join_parameter_a(edge.join, edge.along[i]),
                 edge.points[i]);
    }
  }
  return chain;
}

std::vector<std::vector<int>> TessellationEdges::rim_loops() const {
  std::vector<std::vector<std::array<int, 2>>> segments(network_.rims.size());
  for (const Edge& edge : edges_) {
    if (edge.rim < 0) continue;
    const bool forward = runs_forward(edge.join.a.side);  // as the wall runs it; the cap does not
    for (std::size_t k = 0; k + 1 < edge.points.size(); ++k) {
      const std::array wall{edge.points[k], edge.points[k + 1]};
      segments[index(edge.rim)].push_back(forward ? std::array{wall[1], wall[0]} : wall);
    }
  }
  std::vector<std::vector<int>> loops;
  for (auto& of_rim : segments) loops.push_back(closed_chain(std::move(of_rim)));
  return loops;
}

}  // namespace angiospline
