// Networks to finite-element meshes and back: refinement that keeps patches meeting control point
// by control point.
#include <algorithm>
#include <cmath>
#include <numeric>

#include <Eigen/SparseCore>
#include <fmt/format.h>

#include "kernel/numerics/sparse_cholesky.h"
#include "kernel/refine/control_mesh.h"
#include "kernel/refine/refinement.h"
#include "recovery/thesis/deform/mesh.h"

namespace angiospline {
namespace {

// Parameter directions of patches (2 * patch + 0 for u, + 1 for v) that shared boundaries force to
// be cut alike, each with whether it runs against the first of its class.
class Directions {
 public:
  explicit Directions(std::size_t count) : parent_(count), against_(count, 0) {
    std::iota(parent_.begin(), parent_.end(), std::size_t{0});
  }
  struct Root {
    std::size_t of;
    bool against;
  };
  Root find(std::size_t i) const {
    bool against = false;
    for (; parent_[i] != i; i = parent_[i]) against ^= against_[i] != 0;
    return {i, against};
  }
  // Directions a and b are one, run against each other or not.
  void join(std::size_t a, std::size_t b, bool reversed) {
    const Root ra = find(a), rb = find(b);
    const bool against = ra.against ^ rb.against ^ reversed;
    if (ra.of == rb.of) {
      if (against) folded_.push_back(ra.of);
      return;
    }
    parent_[std::max(ra.of, rb.of)] = std::min(ra.of, rb.of);
    against_[std::max(ra.of, rb.of)] = against ? 1 : 0;
  }
  // A class that meets itself in reverse must be cut symmetrically.
  std::vector<std::size_t> folded() const {
    std::vector<std::size_t> roots;
    for (const std::size_t f : folded_) roots.push_back(find(f).of);
    return roots;
  }

 private:
  std::vector<std::size_t> parent_;
  std::vector<char> against_;
  std::vector<std::size_t> folded_;
};

bool along_v(PatchSide side) { return side == PatchSide::kU0 || side == PatchSide::kU1; }

std::size_t direction_of(const Side& side) {
  return 2 * static_cast<std::size_t>(side.patch) + (along_v(side.side) ? 1 : 0);
}

const KnotVector& knots_of(const Patch& patch, bool v) { return v ? patch.v : patch.u; }

bool is_whole(const Side& side, const Patch& patch) {
  const KnotVector& knots = knots_of(patch, along_v(side.side));
  return side.from == knots.first() && side.to == knots.last();
}

// Column of control point t along a side, in the numbering of the patch.
std::size_t column_on_side(const Patch& patch, PatchSide side, int t) {
  const int nu = patch.u.control_point_count(), nv = patch.v.control_point_count();
  const auto at = [&](int i, int j) { return static_cast<std::size_t>(i) * nv + j; };
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

using Pieces = std::vector<int>;  // for each knot span

// How many pieces `fine` cuts each span of `coarse` into.
Pieces pieces_of(const KnotVector& coarse, const KnotVector& fine) {
  const std::vector<double> marks = coarse.breakpoints(), all = fine.breakpoints();
  Pieces pieces(marks.size() - 1, 0);
  std::size_t span = 0;
  for (std::size_t i = 0; i + 1 < all.size(); ++i) {
    while (span + 2 < marks.size() && all[i] >= marks[span + 1]) ++span;
    ++pieces[span];
  }
  return pieces;
}

void raise(Pieces& pieces, Pieces other, bool against) {
  if (against) std::reverse(other.begin(), other.end());
  for (std::size_t i = 0; i < pieces.size(); ++i) pieces[i] = std::max(pieces[i], other[i]);
}

KnotVector cut(const KnotVector& knots, Pieces pieces, bool against) {
  if (against) std::reverse(pieces.begin(), pieces.end());
  const std::vector<double> marks = knots.breakpoints();
  std::vector<double> added;
  for (std::size_t s = 0; s + 1 < marks.size(); ++s)
    for (int k = 1; k < pieces[s]; ++k)
      added.push_back(marks[s] + (marks[s + 1] - marks[s]) * k / pieces[s]);
  return *with_knots(knots, added);
}

Result<void> check(const SurfaceNetwork& network, const NetworkMeshOptions& options) {
  const auto bad = [](std::string what, std::string where, std::string value, std::string rule) {
    return fail({ErrorKind::kBadInput, std::move(what), std::move(where), std::move(value),
                 std::move(rule)});
  };
  if (!(options.tolerance_mm >= 0) || !std::isfinite(options.tolerance_mm))
    return bad("tolerance of the mesh is not usable", "mesh",
               fmt::format("{}", options.tolerance_mm), "in mm, at least 0");
  if (!(options.longest_side_mm >= 0) || !std::isfinite(options.longest_side_mm))
    return bad("longest side of the mesh is not usable", "mesh",
               fmt::format("{}", options.longest_side_mm), "in mm, at least 0");
  if (options.least_pieces < 1)
    return bad("least number of pieces is not usable", "mesh",
               fmt::format("{}", options.least_pieces), "at least 1");
  for (const Join& join : network.joins)
    for (const Side* side : {&join.a, &join.b})
      if (!is_whole(*side, network.patches[static_cast<std::size_t>(side->patch)]))
        return bad("join of a part of a side",
                   fmt::format("patches {} and {}", join.a.patch, join.b.patch),
                   fmt::format("{} to {}", side->from, side->to),
                   "only whole sides can share the nodes of a finite-element mesh");
  return {};
}

// Pieces of every direction's class, at the class's root.
Result<std::vector<Pieces>> wanted_pieces(const SurfaceNetwork& network,
                                          const Directions& directions,
                                          const NetworkMeshOptions& options) {
  std::vector<Pieces> wanted(2 * network.patches.size());
  for (std::size_t p = 0; p < network.patches.size(); ++p) {
    const Patch& patch = network.patches[p];
    KnotVector fine_u = patch.u, fine_v = patch.v;
    if (options.tolerance_mm > 0) {
      auto fine = refine_to_tolerance(patch_surface(network, static_cast<int>(p)),
                                      {options.tolerance_mm, options.most_nodes});
      if (!fine) return fail(fine.error());
      fine_u = fine->surface.u();
      fine_v = fine->surface.v();
    }
    for (const bool v : {false, true}) {
      const auto [root, against] = directions.find(2 * p + (v ? 1 : 0));
      Pieces pieces = pieces_of(knots_of(patch, v), v ? fine_v : fine_u);
      for (int& k : pieces) k = std::max(k, options.least_pieces);
      if (wanted[root].empty()) wanted[root].assign(pieces.size(), 1);
      if (wanted[root].size() != pieces.size())
        return fail({ErrorKind::kBadInput, "patches with different knots meet",
                     fmt::format("patch {}", p), fmt::format("{} spans", pieces.size()),
                     fmt::format("{} spans on the other side", wanted[root].size())});
      raise(wanted[root], std::move(pieces), against);
    }
  }
  for (const std::size_t root : directions.folded()) raise(wanted[root], wanted[root], true);
  return wanted;
}

// Numbers the fine control points, one number for all that joins make one: the first occurrence's
// order. Returns the number of each, patch after patch.
std::vector<int> shared_numbers(const SurfaceNetwork& fine, const std::vector<std::size_t>& first) {
  std::vector<std::size_t> parent(first.back());
  std::iota(parent.begin(), parent.end(), std::size_t{0});
  const auto root = [&](std::size_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  for (const Join& join : fine.joins) {
    const auto pa = static_cast<std::size_t>(join.a.patch),
               pb = static_cast<std::size_t>(join.b.patch);
    const Patch &a = fine.patches[pa], &b = fine.patches[pb];
    const int count = knots_of(a, along_v(join.a.side)).control_point_count();
    for (int t = 0; t < count; ++t) {
      const std::size_t i = root(first[pa] + column_on_side(a, join.a.side, t));
      const std::size_t j =
          root(first[pb] + column_on_side(b, join.b.side, join.reversed ? count - 1 - t : t));
      parent[std::max(i, j)] = std::min(i, j);
    }
  }
  std::vector<int> number(parent.size(), -1);
  int next = 0;
  for (std::size_t i = 0; i < parent.size(); ++i) {
    const std::size_t r = root(i);
    if (number[r] < 0) number[r] = next++;
    number[i] = number[r];
  }
  return number;
}

// Cuts the spans of directions whose control mesh has sides longer than `longest` into more pieces,
// as many as it takes if sides shrink alike. Returns whether there were any.
bool shorten(std::vector<Pieces>& pieces, const SurfaceNetwork& fine, const Directions& directions,
             double longest_mm) {
  std::vector<double> side(pieces.size(), 0.0);
  for (std::size_t p = 0; p < fine.patches.size(); ++p) {
    const auto net = patch_surface(fine, static_cast<int>(p));
    const auto raise_to = [&](std::size_t direction, double length) {
      double& most = side[directions.find(direction).of];
      most = std::max(most, length);
    };
    for (int i = 0; i < net.u_count(); ++i)
      for (int j = 0; j < net.v_count(); ++j) {
        const Vec3 at = net.control_point(i, j);
        if (i > 0) raise_to(2 * p, (at - net.control_point(i - 1, j)).norm());
        if (j > 0) raise_to(2 * p + 1, (at - net.control_point(i, j - 1)).norm());
      }
  }
  bool any = false;
  for (std::size_t d = 0; d < pieces.size(); ++d) {
    if (side[d] <= longest_mm) continue;
    any = true;
    for (int& k : pieces[d]) {
      const double more = std::min(side[d] / longest_mm, 2.0);
      k = std::max(k + 1, static_cast<int>(k * more));
    }
  }
  return any;
}

// Every direction cut into its class's pieces, and what patches share made one.
Result<RefinedNetwork> cut_network(const SurfaceNetwork& network, const Directions& directions,
                                   const std::vector<Pieces>& pieces,
                                   const NetworkMeshOptions& options) {
  RefinedNetwork out{network, 0.0};
  out.network.dependencies.clear();
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
    first.push_back(first.back() + static_cast<std::size_t>(nets.back().cols()));
  }
  const std::vector<int> number = shared_numbers(out.network, first);
  const int nodes = number.empty() ? 0 : *std::max_element(number.begin(), number.end()) + 1;
  if (nodes > options.most_nodes)
    return fail({ErrorKind::kBadInput, "mesh needs more nodes than allowed", "mesh",
                 fmt::format("{}", nodes), fmt::format("at most {}", options.most_nodes)});
  out.network.control_points_mm.resize(3, nodes);
  for (std::size_t p = nets.size(); p-- > 0;) {  // backwards: the first occurrence is kept
    Patch& patch = out.network.patches[p];
    patch.control.resize(static_cast<std::size_t>(nets[p].cols()));
    for (std::size_t k = 0; k < patch.control.size(); ++k) {
      patch.control[k] = number[first[p] + k];
      out.network.control_points_mm.col(patch.control[k]) =
          nets[p].col(static_cast<Eigen::Index>(k));
    }
  }
  return out;
}

}  // namespace

Result<RefinedNetwork> refine_network(const SurfaceNetwork& network,
                                      const NetworkMeshOptions& options) {
  if (const auto ok = check(network, options); !ok) return fail(ok.error());
  Directions directions(2 * network.patches.size());
  for (const Join& join : network.joins)
    directions.join(direction_of(join.a), direction_of(join.b), join.reversed);
  // refine_to_tolerance cuts where the bound is large; equal pieces of the same number can miss the
  // tolerance by a little, and then aim lower.
  NetworkMeshOptions aim = options;
  auto wanted = wanted_pieces(network, directions, aim);
  for (;;) {
    if (!wanted) return fail(wanted.error());
    auto out = cut_network(network, directions, *wanted, options);
    if (!out) return out;
    if (options.tolerance_mm > 0 && out->distance_mm > options.tolerance_mm) {
      aim.tolerance_mm *= 0.9 * options.tolerance_mm / out->distance_mm;
      wanted = wanted_pieces(network, directions, aim);
    } else if (options.longest_side_mm == 0 ||
               !shorten(*wanted, out->network, directions, options.longest_side_mm)) {
      return out;
    }
  }
}

DeformMesh control_mesh(const SurfaceNetwork& network) {
  DeformMesh mesh;
  mesh.nodes_mm = network.control_points_mm;
  std::vector<std::pair<int, int>> springs;
  std::vector<char> used(static_cast<std::size_t>(mesh.node_count()), 0);
  for (const Patch& patch : network.patches) {
    const int nu = patch.u.control_point_count(), nv = patch.v.control_point_count();
    const auto node = [&](int i, int j) {
      return patch.control[static_cast<std::size_t>(i) * nv + static_cast<std::size_t>(j)];
    };
    const auto spring = [&](int a, int b) {
      if (a != b) springs.emplace_back(std::min(a, b), std::max(a, b));
    };
    for (const int k : patch.control) used[static_cast<std::size_t>(k)] = 1;
    for (int i = 0; i < nu; ++i)
      for (int j = 0; j < nv; ++j) {
        if (i + 1 < nu) spring(node(i, j), node(i + 1, j));
        if (j + 1 < nv) spring(node(i, j), node(i, j + 1));
        if (i + 1 < nu && j + 1 < nv)
          mesh.faces.push_back({node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)});
      }
  }
  EXPECTS(std::find(used.begin(), used.end(), 0) == used.end());
  std::sort(springs.begin(), springs.end());
  springs.erase(std::unique(springs.begin(), springs.end()), springs.end());
  mesh.springs.resize(2, std::ssize(springs));
  for (std::size_t s = 0; s < springs.size(); ++s)
    mesh.springs.col(static_cast<Eigen::Index>(s)) << springs[s].first, springs[s].second;
  return mesh;
}

RefinedNetwork coarsen_network(const SurfaceNetwork& fine, const SurfaceNetwork& coarse) {
  EXPECTS(fine.patches.size() == coarse.patches.size());
  using Sparse = Eigen::SparseMatrix<double>;
  std::vector<Eigen::Triplet<double>> entries;
  std::vector<char> done(static_cast<std::size_t>(fine.control_points_mm.cols()), 0);
  for (std::size_t p = 0; p < fine.patches.size(); ++p) {
    const Patch &f = fine.patches[p], &c = coarse.patches[p];
    const CompactRows U = refinement_matrix(c.u, f.u), V = refinement_matrix(c.v, f.v);
    const int nv = f.v.control_point_count(), coarse_nv = c.v.control_point_count();
    for (int i = 0; i < f.u.control_point_count(); ++i)
      for (int j = 0; j < nv; ++j) {
        const int row = f.control[static_cast<std::size_t>(i) * nv + static_cast<std::size_t>(j)];
        if (done[static_cast<std::size_t>(row)]++ != 0) continue;
        for (int a = 0; a < U.width(); ++a)
          for (int b = 0; b < V.width(); ++b)
            entries.emplace_back(row,
                                 c.control[static_cast<std::size_t>(U.first(i) + a) * coarse_nv +
                                           static_cast<std::size_t>(V.first(j) + b)],
                                 U.row(i)[a] * V.row(j)[b]);
      }
  }
  Sparse A(fine.control_points_mm.cols(), coarse.control_points_mm.cols());
  A.setFromTriplets(entries.begin(), entries.end());
  const Eigen::MatrixX3d rest =
      (fine.control_points_mm - coarse.control_points_mm * A.transpose()).transpose();
  const SparseCholesky normal(A.transpose() * A);
  const Eigen::MatrixX3d step = normal.solve(A.transpose() * rest);
  RefinedNetwork out{coarse, 0.0};
  out.network.control_points_mm += step.transpose();
  const Eigen::MatrixX3d left = rest - A * step;
  out.distance_mm = std::sqrt(left.rowwise().squaredNorm().maxCoeff());
  return out;
}

}  // namespace angiospline
