#include "recovery/thesis/deform/network_cut.h"

#include <algorithm>
#include <numeric>

#include <fmt/format.h>

#include "base/disjoint_sets.h"
#include "base/index.h"
#include "kernel/refine/control_mesh.h"
#include "kernel/refine/refinement.h"

namespace angiospline {
namespace {

std::size_t direction_of(const Side& side) {
  return 2 * index(side.patch) + (runs_with_v(side.side) ? 1 : 0);
}

// Column of control point t along a side, in the numbering of the patch.
std::size_t column_on_side(const Patch& patch, PatchSide side, int t) {
  const int nu = patch.u.control_point_count(), nv = patch.v.control_point_count();
  const auto at = [&](int i, int j) { return index(i) * nv + j; };
  switch (side) {
    case PatchSide::kU0:
      return at(0, t);
    case PatchSide::kU1:
      return at(nu - 1, t);
    case PatchSide::kV0:
      return at(t, 0);
    case PatchSide::kV1:
      return at(t, nv - 1);
  }
  return 0;
}

KnotVector cut(const KnotVector& knots, SpanPieces pieces, bool against) {
  if (against) std::reverse(pieces.begin(), pieces.end());
  const std::vector<double> marks = knots.breakpoints();
  std::vector<double> added;
  for (std::size_t s = 0; s + 1 < marks.size(); ++s)
    for (int k = 1; k < pieces[s]; ++k)
      added.push_back(marks[s] + (marks[s + 1] - marks[s]) * k / pieces[s]);
  return *with_knots(knots, added);
}

// Numbers the fine control points, one number for all that joins make one: the first occurrence's
// order. Returns the number of each, patch after patch.
std::vector<int> shared_numbers(const SurfaceNetwork& fine, const std::vector<std::size_t>& first) {
  DisjointSets shared(first.back());

  // A join makes one of each pair of control points along it, end against end where reversed.
  for (const Join& join : fine.joins) {
    const auto pa = index(join.a.patch), pb = index(join.b.patch);
    const Patch &a = fine.patches[pa], &b = fine.patches[pb];
    const int count = knots_along(a, runs_with_v(join.a.side)).control_point_count();
    for (int t = 0; t < count; ++t) {
      const int across = join.reversed ? count - 1 - t : t;
      shared.join(static_cast<int>(first[pa] + column_on_side(a, join.a.side, t)),
                  static_cast<int>(first[pb] + column_on_side(b, join.b.side, across)));
    }
  }
  return shared.numbers();
}

}  // namespace

bool runs_with_v(PatchSide side) { return side == PatchSide::kU0 || side == PatchSide::kU1; }

const KnotVector& knots_along(const Patch& patch, bool v) { return v ? patch.v : patch.u; }

PatchDirections::PatchDirections(const SurfaceNetwork& network)
    : parent_(2 * network.patches.size()), against_(parent_.size(), 0) {
  std::iota(parent_.begin(), parent_.end(), std::size_t{0});
  for (const Join& j : network.joins) join(direction_of(j.a), direction_of(j.b), j.reversed);
}

PatchDirections::Root PatchDirections::find(std::size_t direction) const {
  bool against = false;
  for (; parent_[direction] != direction; direction = parent_[direction])
    against ^= against_[direction] != 0;
  return {direction, against};
}

void PatchDirections::join(std::size_t a, std::size_t b, bool reversed) {
  const Root ra = find(a), rb = find(b);
  const bool against = ra.against ^ rb.against ^ reversed;
  if (ra.of == rb.of) {
    if (against) folded_.push_back(ra.of);
    return;
  }
  parent_[std::max(ra.of, rb.of)] = std::min(ra.of, rb.of);
  against_[std::max(ra.of, rb.of)] = against ? 1 : 0;
}

std::vector<std::size_t> PatchDirections::folded() const {
  std::vector<std::size_t> roots;
  for (const std::size_t f : folded_) roots.push_back(find(f).of);
  return roots;
}

Result<RefinedNetwork> cut_network(const SurfaceNetwork& network, const PatchDirections& directions,
                                   const std::vector<SpanPieces>& pieces, int most_nodes) {
  RefinedNetwork out{network, 0.0};
  out.network.dependencies.clear();

  // Refinement moves no surface; what its control mesh departs from it by is bounded.
  std::vector<Points3> nets;
  std::vector<std::size_t> first{0};
  for (std::size_t p = 0; p < network.patches.size(); ++p) {
    Patch& patch = out.network.patches[p];
    const auto u = directions.find(2 * p), v = directions.find(2 * p + 1);
    patch.u = cut(patch.u, pieces[u.of], u.against);
    patch.v = cut(patch.v, pieces[v.of], v.against);
    const auto fine = refine(patch_surface(network, static_cast<int>(p)), patch.u, patch.v);
    out.distance_mm = std::max(out.distance_mm, control_mesh_distance(fine));
    nets.push_back(fine.control_points());
    first.push_back(first.back() + index(nets.back().cols()));
  }

  const std::vector<int> number = shared_numbers(out.network, first);
  const int nodes = number.empty() ? 0 : *std::max_element(number.begin(), number.end()) + 1;
  if (nodes > most_nodes)
    return fail({ErrorKind::kBadInput, "mesh needs more nodes than allowed", "mesh",
                 fmt::format("{}", nodes), fmt::format("at most {}", most_nodes)});

  out.network.control_points_mm.resize(3, nodes);
  for (std::size_t p = nets.size(); p-- > 0;) {  // backwards: the first occurrence is kept
    Patch& patch = out.network.patches[p];
    patch.control.resize(index(nets[p].cols()));
    for (std::size_t k = 0; k < patch.control.size(); ++k) {
      patch.control[k] = number[first[p] + k];
      out.network.control_points_mm.col(patch.control[k]) =
          nets[p].col(static_cast<Eigen::Index>(k));
    }
  }
  return out;
}

}  // namespace angiospline
