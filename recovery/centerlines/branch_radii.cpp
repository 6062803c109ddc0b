#include "recovery/centerlines/branch_radii.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/index.h"
#include "base/median.h"
#include "recovery/centerlines/rules.h"

namespace angiospline {
namespace {

using namespace centerline_rules;

// Linear between known values, constant beyond them.
void fill_unknown(std::vector<double>& r, const std::vector<bool>& known) {
  std::optional<std::size_t> last;
  for (std::size_t i = 0; i < r.size(); ++i) {
    if (!known[i]) continue;
    for (std::size_t k = last ? *last + 1 : 0; k < i; ++k) {
      const double s = last ? static_cast<double>(k - *last) / static_cast<double>(i - *last) : 1.0;
      r[k] = last ? (1.0 - s) * r[*last] + s * r[i] : r[i];
    }
    last = i;
  }
  for (std::size_t k = *last + 1; k < r.size(); ++k) r[k] = r[*last];
}

// Along a chain, by how much the sections' radii fall short of what counting says: the mean over
// two radii to both sides, since a single count scatters; 1 where nothing is known.
std::vector<double> corrections_of(const VesselGraph& graph, const BranchPoints& points,
                                   const std::vector<int>& u) {
  // Running sums, so that every mean costs the same.
  std::vector<double> sum(u.size() + 1, 0.0), count(u.size() + 1, 0.0);
  for (std::size_t i = 0; i < u.size(); ++i) {
    sum[i + 1] = sum[i] + points.counted[u[i]];
    count[i + 1] = count[i] + (points.counted[u[i]] > 0.0 ? 1.0 : 0.0);
  }

  std::vector<double> correction(u.size(), 1.0);
  std::vector<bool> known(u.size());
  const double voxel_mm = graph.grid.spacing_mm.maxCoeff();
  const double pace = graph.grid.spacing_mm.minCoeff();
  for (std::size_t i = 0; i < u.size(); ++i) {
    const auto reach = static_cast<std::size_t>(std::lround(
        std::max(kCorrectionRadii * points.radius_mm[u[i]], kCorrectionVoxels * voxel_mm) / pace));
    const std::size_t from = i - std::min(i, reach), to = std::min(u.size(), i + reach + 1);
    known[i] = count[to] > count[from];
    if (known[i]) correction[i] = (sum[to] - sum[from]) / (count[to] - count[from]);
  }
  if (count.back() > 0.0) fill_unknown(correction, known);
  return correction;
}

// Sections' radii along a chain; those of open sections from the nearest closed ones.
std::vector<double> section_radii(const VesselGraph& graph, const BranchPoints& points,
                                  const std::vector<int>& u) {
  std::vector<double> r(u.size());
  std::vector<bool> known(u.size());
  bool any = false;
  for (std::size_t i = 0; i < u.size(); ++i) {
    // A node's section belongs to one branch only where it is a free end.
    const bool is_node = index(u[i]) < graph.nodes.size() && !graph.nodes[index(u[i])].is_end();
    known[i] = !is_node && points.radius_mm[u[i]] > 0.0;
    r[i] = known[i] ? points.radius_mm[u[i]] : points.inscribed_mm[u[i]];
    any = any || known[i];
  }
  if (any) fill_unknown(r, known);
  return r;
}

}  // namespace

Eigen::VectorXd radii_along(const VesselGraph& graph, const BranchPoints& points,
                            const SmoothingChain& chain) {
  const std::vector<int>& u = chain.unknowns;
  std::vector<double> r = section_radii(graph, points, u);
  const std::vector<double> correction = corrections_of(graph, points, u);
  for (std::size_t i = 0; i < u.size(); ++i) r[i] *= correction[i];

  // A median of five removes single outliers.
  const std::ptrdiff_t n = std::ssize(u);
  std::vector<double> clean(r);
  for (std::ptrdiff_t i = 0; i < n; ++i) {
    const std::ptrdiff_t w = std::min({kMedianReach, i, n - 1 - i});
    clean[static_cast<std::size_t>(i)] = median({r.begin() + (i - w), r.begin() + (i + w + 1)});
  }

  // A mean over a radius removes the noise of voxels.
  Eigen::VectorXd smooth(n);
  for (std::ptrdiff_t i = 0; i < n; ++i) {
    const auto reach = static_cast<std::ptrdiff_t>(
        std::lround(0.5 * clean[static_cast<std::size_t>(i)] / graph.grid.spacing_mm.minCoeff()));
    const std::ptrdiff_t w = std::min({std::max<std::ptrdiff_t>(1, reach), i, n - 1 - i});
    double sum = 0.0;
    for (std::ptrdiff_t k = i - w; k <= i + w; ++k) sum += clean[static_cast<std::size_t>(k)];
    smooth[i] = sum / static_cast<double>(2 * w + 1);
  }
  return smooth;
}

}  // namespace angiospline
