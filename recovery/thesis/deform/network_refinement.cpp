#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "base/index.h"
#include "kernel/refine/control_mesh.h"
#include "recovery/thesis/deform/mesh.h"
#include "recovery/thesis/deform/network_cut.h"
#include "recovery/thesis/deform/rules.h"

namespace angiospline {
namespace {

using namespace deform_rules;

bool is_whole(const Side& side, const Patch& patch) {
  const KnotVector& knots = knots_along(patch, runs_with_v(side.side));
  return side.from == knots.first() && side.to == knots.last();
}

// How many pieces `fine` cuts each span of `coarse` into.
SpanPieces pieces_of(const KnotVector& coarse, const KnotVector& fine) {
  const std::vector<double> marks = coarse.breakpoints(), all = fine.breakpoints();
  SpanPieces pieces(marks.size() - 1, 0);
  std::size_t span = 0;
  for (std::size_t i = 0; i + 1 < all.size(); ++i) {
    while (span + 2 < marks.size() && all[i] >= marks[span + 1]) ++span;
    ++pieces[span];
  }
  return pieces;
}

void raise(SpanPieces& pieces, SpanPieces other, bool against) {
  if (against) std::reverse(other.begin(), other.end());
  for (std::size_t i = 0; i < pieces.size(); ++i) pieces[i] = std::max(pieces[i], other[i]);
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
      if (!is_whole(*side, network.patches[index(side->patch)]))
        return bad("join of a part of a side",
                   fmt::format("patches {} and {}", join.a.patch, join.b.patch),
                   fmt::format("{} to {}", side->from, side->to),
                   "only whole sides can share the nodes of a finite-element mesh");
  return {};
}

// Pieces of every direction's class, at the class's root.
Result<std::vector<SpanPieces>> wanted_pieces(const SurfaceNetwork& network,
                                              const PatchDirections& directions,
                                              const NetworkMeshOptions& options) {
  std::vector<SpanPieces> wanted(2 * network.patches.size());
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

    // The larger demand of all the patches that must be cut alike counts.
    for (const bool v : {false, true}) {
      const auto [root, against] = directions.find(2 * p + (v ? 1 : 0));
      SpanPieces pieces = pieces_of(knots_along(patch, v), v ? fine_v : fine_u);
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

// Cuts the spans of directions whose control mesh has sides longer than `longest` into more pieces,
// as many as it takes if sides shrink alike. Returns whether there were any.
bool shorten(std::vector<SpanPieces>& pieces, const SurfaceNetwork& fine,
             const PatchDirections& directions, double longest_mm) {
  // The longest side of the control mesh in every direction's class.
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
      const double more = std::min(side[d] / longest_mm, kMostFiner);
      k = std::max(k + 1, static_cast<int>(k * more));
    }
  }
  return any;
}

}  // namespace

Result<RefinedNetwork> refine_network(const SurfaceNetwork& network,
                                      const NetworkMeshOptions& options) {
  if (const auto ok = check(network, options); !ok) return fail(ok.error());
  const PatchDirections directions(network);

  // refine_to_tolerance cuts where the bound is large; equal pieces of the same number can miss the
  // tolerance by a little, and then aim lower.
  NetworkMeshOptions aim = options;
  auto wanted = wanted_pieces(network, directions, aim);
  for (;;) {
    if (!wanted) return fail(wanted.error());
    auto out = cut_network(network, directions, *wanted, options.most_nodes);
    if (!out) return out;
    if (options.tolerance_mm > 0 && out->distance_mm > options.tolerance_mm) {
      aim.tolerance_mm *= kAimLower * options.tolerance_mm / out->distance_mm;
      wanted = wanted_pieces(network, directions, aim);
    } else if (options.longest_side_mm == 0 ||
               !shorten(*wanted, out->network, directions, options.longest_side_mm)) {
      return out;
    }
  }
}

}  // namespace angiospline
