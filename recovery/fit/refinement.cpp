#include "recovery/fit/refinement.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/index.h"
#include "recovery/fit/closed_surface.h"
#include "recovery/fit/rings.h"
#include "recovery/fit/rules.h"

namespace angiospline {
namespace {

using namespace fit_rules;

// Length of each span of a ring along its patches' middle lines, the longest of the patches.
std::vector<double> span_lengths(const SurfaceNetwork& network, const StripRing& ring) {
  constexpr int kSteps = 4;
  const std::vector<double> breaks = ring.u.breakpoints();
  std::vector<double> lengths(breaks.size() - 1, 0.0);

  for (const int p : ring.patches) {
    const BSplineSurface<3> surface = patch_surface(network, p);
    for (std::size_t s = 0; s + 1 < breaks.size(); ++s) {
      double length = 0;
      Vec3 before = surface.at(breaks[s], 0.5);
      for (int k = 1; k <= kSteps; ++k) {
        const Vec3 next = surface.at(breaks[s] + (breaks[s + 1] - breaks[s]) * k / kSteps, 0.5);
        length += (next - before).norm();
        before = next;
      }
      lengths[s] = std::max(lengths[s], length);
    }
  }
  return lengths;
}

double side_mm(const SurfaceNetwork& network, int patch) {
  const BSplineSurface<3> surface = patch_surface(network, patch);
  return std::max((surface.at(0, 0.5) - surface.at(1, 0.5)).norm(),
                  (surface.at(0.5, 0) - surface.at(0.5, 1)).norm());
}

}  // namespace

bool LargeResiduals::any() const {
  return std::find(regions.begin(), regions.end(), char{1}) != regions.end();
}

void LargeResiduals::leave_out(const FitMesh& mesh, int region) {
  regions[index(region)] = 0;
  for (std::size_t k = 0; k < large.size(); ++k) {
    if (mesh.regions[k] == region) large[k] = 0;
  }
}

LargeResiduals large_residuals(const Evidence& evidence, const SurfaceNetwork& network,
                               const FitMesh& mesh, MeshSmoother& smoother,
                               const std::vector<char>& excluded, const ResidualOptions& options) {
  const Eigen::Index n = mesh.size();
  LargeResiduals found;
  found.mean_mm = Eigen::VectorXd::Zero(n);
  found.large.assign(mesh.nodes.size(), 0);
  found.regions.assign(network.regions.size(), 0);
  found.amounts_mm3.assign(network.regions.size(), 0.0);
  if (!evidence.found()) return found;

  const WallOffsets wall =
      evidence.offsets(mesh, Eigen::VectorXd::Zero(n), options.half_window_vox);
  const double voxel = evidence.voxel_mm();
  const double reach = options.mean_vox * voxel;
  found.mean_mm = smoother.mean(wall.mm, wall.weight, reach);

  // What noise leaves of such a mean: of (1 - l^2 Laplacian)^-1 white noise of density S keeps the
  // variance S / (4 pi l^2).
  const double noise = evidence.noise_density(options.half_window_vox, smoother);
  const double deviation = std::sqrt(noise / (4 * std::numbers::pi)) / reach;
  const double least = std::max(options.deviations * deviation, options.least_vox * voxel);

  for (Eigen::Index k = 0; k < n; ++k) {
    const std::size_t r = index(mesh.regions[index(k)]);
    if (excluded[r] || !(wall.weight(k) > 0)) continue;
    if (!(std::abs(found.mean_mm(k)) > least)) continue;
    found.large[index(k)] = found.regions[r] = 1;
    found.amounts_mm3[r] += std::abs(found.mean_mm(k)) * smoother.mass_mm2()(k);
  }
  return found;
}

Eigen::VectorXd share_around(const std::vector<char>& marks, MeshSmoother& smoother,
                             double around) {
  const Eigen::Index n = std::ssize(marks);
  Eigen::VectorXd values(n), share(n);
  for (Eigen::Index k = 0; k < n; ++k) values(k) = marks[index(k)];
  const Eigen::VectorXd near = smoother.mean(values, Eigen::VectorXd::Ones(n), around);

  // From nothing to all by 3 t^2 - 2 t^3, so that moves die out without a crease.
  for (Eigen::Index k = 0; k < n; ++k) {
    const double t =
        marks[index(k)]
            ? 1.0
            : std::clamp((near(k) - kRefinement.none) / (kRefinement.full - kRefinement.none), 0.0,
                         1.0);
    share(k) = t * t * (3 - 2 * t);
  }
  return share;
}

namespace {

// Spans of bodies, ring by ring, that hold a node which moves by more than half of what it is asked
// for; empty for other rings.
std::vector<std::vector<char>> moving_spans(const SurfaceNetwork& network,
                                            const std::vector<StripRing>& rings,
                                            const FitMesh& mesh, const Eigen::VectorXd& share) {
  std::vector<int> ring_of(network.patches.size(), -1);
  std::vector<std::vector<char>> marked(rings.size());
  for (std::size_t r = 0; r < rings.size(); ++r) {
    if (network.regions[index(rings[r].region)].kind != RegionKind::kBody) continue;
    for (const int p : rings[r].patches) ring_of[index(p)] = static_cast<int>(r);
    marked[r].assign(rings[r].u.breakpoints().size() - 1, 0);
  }

  for (int k = 0; k < mesh.size(); ++k) {
    const int r = ring_of[index(mesh.origins[index(k)].patch)];
    if (r < 0 || !(share(k) > 0.5)) continue;
    const std::vector<double> breaks = rings[index(r)].u.breakpoints();
    const auto next = std::upper_bound(breaks.begin(), breaks.end(), mesh.origins[index(k)].uv.x());
    const auto span =
        std::clamp<std::ptrdiff_t>(next - breaks.begin() - 1, 0, std::ssize(marked[index(r)]) - 1);
    marked[index(r)][index(span)] = 1;
  }
  return marked;
}

}  // namespace

LocallyRefinedNetwork refined_where_large(const SurfaceNetwork& network, const FitMesh& mesh,
                                          const LargeResiduals& residuals,
                                          const Eigen::VectorXd& share, double shortest_mm) {
  // Bodies: marked spans are halved, if halves are long enough.
  const std::vector<StripRing> rings = strip_rings(network);
  const std::vector<std::vector<char>> marked = moving_spans(network, rings, mesh, share);
  std::vector<std::vector<double>> added(rings.size());
  std::vector<char> got_more(network.regions.size(), 0);
  for (std::size_t r = 0; r < rings.size(); ++r) {
    if (std::find(marked[r].begin(), marked[r].end(), char{1}) == marked[r].end()) continue;
    const std::vector<double> breaks = rings[r].u.breakpoints();
    const std::vector<double> lengths = span_lengths(network, rings[r]);
    for (std::size_t s = 0; s < marked[r].size(); ++s) {
      if (!marked[r][s] || lengths[s] < 2 * shortest_mm) continue;
      added[r].push_back((breaks[s] + breaks[s + 1]) / 2);
      got_more[index(rings[r].region)] = 1;
    }
  }
  LocallyRefinedNetwork refined{with_knots_added(network, rings, added), {}};

  // Closed surfaces: all patches are cut in four.
  const std::vector<std::vector<int>> closed = closed_patches(refined.network);
  for (std::size_t r = 0; r < closed.size(); ++r) {
    if (closed[r].empty() || !residuals.regions[r] ||
        4 * closed[r].size() > kRefinement.most_patches) {
      continue;
    }
    double longest = 0;
    for (const int p : closed[r]) longest = std::max(longest, side_mm(refined.network, p));
    if (longest < 2 * kRefinement.patch_spans * shortest_mm) continue;
    refined.network = with_quartered(refined.network, closed[r]);
    got_more[r] = 1;
  }

  for (std::size_t r = 0; r < got_more.size(); ++r) {
    if (got_more[r]) refined.regions.push_back(network.regions[r].name);
  }
  return refined;
}

}  // namespace angiospline
