#include "recovery/analysis/compare_masks.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "kernel/geometry/point_index.h"

namespace angiospline {
namespace {

// Centres of the faces of a mask, in mm along the axes of its grid, and their areas.
struct Faces {
  std::vector<Vec3> centres;
  std::vector<double> areas;
};

Faces faces_of(const Mask& mask) {
  Faces out;
  const ImageGrid& grid = mask.grid;
  const Vec3 s = grid.spacing_mm;
  const double areas[] = {s[1] * s[2], s[0] * s[2], s[0] * s[1]};

  std::size_t i = 0;
  for (int z = 0; z < grid.size[2]; ++z)
    for (int y = 0; y < grid.size[1]; ++y)
      for (int x = 0; x < grid.size[0]; ++x, ++i) {
        if (mask.voxels[i] == 0) continue;
        for (std::size_t axis = 0; axis < 3; ++axis)
          for (const int step : {-1, 1}) {
            Voxel n{x, y, z};
            n[axis] += step;
            if (grid.contains(n) && mask[n] != 0) continue;
            Vec3 centre(x * s[0], y * s[1], z * s[2]);
            const auto across = static_cast<Eigen::Index>(axis);
            centre[across] += 0.5 * step * s[across];
            out.centres.push_back(centre);
            out.areas.push_back(areas[axis]);
          }
      }
  return out;
}

// From each face of `from` the distance to the nearest of `to`.
std::vector<double> distances(const Faces& from, const Faces& to) {
  const PointIndex places_index(to.centres);
  std::vector<double> out(from.centres.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, out.size(), 1024), [&](const auto& range) {
    for (std::size_t k = range.begin(); k != range.end(); ++k) {
      out[k] = places_index.nearest(from.centres[k]).distance;
    }
  });
  return out;
}

// The least distance that `share` of the area keeps within.
double percentile(const std::vector<double>& values, const std::vector<double>& areas,
                  double share) {
  std::vector<std::size_t> order(values.size());
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return values[a] != values[b] ? values[a] < values[b] : a < b;
  });
  double total = 0, sum = 0;
  for (const double a : areas) total += a;
  for (const std::size_t k : order) {
    sum += areas[k];
    if (sum >= share * total) return values[k];
  }
  return values.empty() ? 0 : values[order.back()];
}

SurfaceDistances surface_distances(const Faces& a, const Faces& b) {
  const std::vector<double> ab = distances(a, b), ba = distances(b, a);
  SurfaceDistances out;
  double area = 0;
  for (std::size_t k = 0; k < ab.size(); ++k) out.mean_mm += ab[k] * a.areas[k], area += a.areas[k];
  for (std::size_t k = 0; k < ba.size(); ++k) out.mean_mm += ba[k] * b.areas[k], area += b.areas[k];
  out.mean_mm /= area;
  out.hausdorff95_mm = std::max(percentile(ab, a.areas, 0.95), percentile(ba, b.areas, 0.95));
  out.hausdorff_mm =
      std::max(*std::max_element(ab.begin(), ab.end()), *std::max_element(ba.begin(), ba.end()));
  return out;
}

// Share of the skeleton's voxels that lie in the mask; 1 for an empty skeleton.
double share_inside(const Mask& skeleton, const Mask& mask) {
  std::size_t all = 0, inside = 0;
  for (std::size_t i = 0; i < skeleton.voxels.size(); ++i) {
    all += skeleton.voxels[i] != 0;
    inside += skeleton.voxels[i] != 0 && mask.voxels[i] != 0;
  }
  return all == 0 ? 1.0 : static_cast<double>(inside) / static_cast<double>(all);
}

}  // namespace

Result<MaskComparison> compare_masks(const Mask& truth, const Mask& result) {
  if (truth.grid.size != result.grid.size)
    return fail({ErrorKind::kBadInput,
                 "masks have different sizes",
                 {},
                 fmt::format("{}x{}x{} and {}x{}x{}", truth.grid.size[0], truth.grid.size[1],
                             truth.grid.size[2], result.grid.size[0], result.grid.size[1],
                             result.grid.size[2]),
                 "they must lie on one grid"});

  // Files round spacing to single precision.
  if (!truth.grid.spacing_mm.isApprox(result.grid.spacing_mm, 1e-4))
    return fail({ErrorKind::kBadInput,
                 "masks have different spacing",
                 {},
                 fmt::format("{:.6g} and {:.6g} mm along x", truth.grid.spacing_mm[0],
                             result.grid.spacing_mm[0]),
                 "they must lie on one grid"});

  MaskComparison c;
  for (std::size_t i = 0; i < truth.voxels.size(); ++i) {
    const bool t = truth.voxels[i] != 0, r = result.voxels[i] != 0;
    c.truth_voxels += t;
    c.result_voxels += r;
    c.both += t && r;
  }
  c.missed = c.truth_voxels - c.both;
  c.beyond = c.result_voxels - c.both;

  const auto share = [](std::size_t part, std::size_t whole) {
    return static_cast<double>(part) / static_cast<double>(whole);
  };
  if (c.truth_voxels > 0) c.missed_percent = 100 * share(c.missed + c.beyond, c.truth_voxels);
  if (c.truth_voxels + c.result_voxels > 0)
    c.dice = share(2 * c.both, c.truth_voxels + c.result_voxels);

  c.truth_topology = topology_numbers(truth);
  c.result_topology = topology_numbers(result);
  if (c.truth_voxels > 0 && c.result_voxels > 0)
    c.surface = surface_distances(faces_of(truth), faces_of(result));
  return c;
}

double centerline_dice(const Mask& truth, const Mask& truth_skeleton, const Mask& result,
                       const Mask& result_skeleton) {
  EXPECTS(truth.grid.size == result.grid.size && truth.grid.size == truth_skeleton.grid.size &&
          truth.grid.size == result_skeleton.grid.size);
  const double precision = share_inside(result_skeleton, truth);
  const double recall = share_inside(truth_skeleton, result);
  return precision + recall == 0 ? 0 : 2 * precision * recall / (precision + recall);
}

}  // namespace angiospline
