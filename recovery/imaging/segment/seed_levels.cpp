#include "recovery/imaging/segment/seed_levels.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "base/median.h"
#include "recovery/imaging/image/gaussian.h"
#include "recovery/imaging/mask/morphology.h"
#include "recovery/imaging/segment/rules.h"

namespace angiospline::segmentation {
namespace {

// A cube around a voxel, vessels bright, not-finite voxels left out of the values.
struct Cube {
  Image<double> grey;  // NaN where not finite
  Voxel seed;          // within it
  std::vector<double> values;
};

Cube cube_around(const AnyImage& image, const Voxel& centre, double half_mm, double sign,
                 double smoothing_mm) {
  const ImageGrid& grid = grid_of(image);
  Voxel low, high, size;
  for (std::size_t i = 0; i < 3; ++i) {
    const int half =
        static_cast<int>(std::lround(half_mm / grid.spacing_mm[static_cast<Eigen::Index>(i)]));
    low[i] = std::max(0, centre[i] - half);
    high[i] = std::min(grid.size[i] - 1, centre[i] + half);
    size[i] = high[i] - low[i] + 1;
  }

  const Image<float> box = smoothed_box(image, low, high, smoothing_mm);
  Cube cube;
  cube.grey.grid.size = size;
  cube.seed = {centre[0] - low[0], centre[1] - low[1], centre[2] - low[2]};

  for (int z = 0; z < size[2]; ++z)
    for (int y = 0; y < size[1]; ++y)
      for (int x = 0; x < size[0]; ++x) {
        const double v = sign * static_cast<double>(box[{x, y, z}]);
        cube.grey.voxels.push_back(v);
        if (std::isfinite(v)) cube.values.push_back(v);
      }
  return cube;
}

// Voxels of the seed's component whose six neighbours in the cube belong to it too.
std::vector<double> inside_of(const Cube& cube, const Components& parts, std::int32_t label) {
  std::vector<double> inside;
  for (std::size_t i = 0; i < cube.grey.voxels.size(); ++i) {
    if (parts.labels.voxels[i] != label) continue;
    const Voxel v = cube.grey.grid.voxel(i);
    bool deep = true;
    for (std::size_t k = 0; k < 3; ++k)
      for (const int step : {-1, 1}) {
        Voxel n = v;
        n[k] += step;
        deep = deep && (!cube.grey.grid.contains(n) || parts.labels[n] == label);
      }
    if (deep) inside.push_back(cube.grey.voxels[i]);
  }
  return inside;
}

SeedLevels levels_in(const Cube& cube, double threshold, double half_mm, const ImageGrid& grid) {
  Mask bright(cube.grey.grid);
  std::vector<double> background;
  for (std::size_t i = 0; i < bright.voxels.size(); ++i) {
    bright.voxels[i] = cube.grey.voxels[i] >= threshold;
    if (cube.grey.voxels[i] < threshold) background.push_back(cube.grey.voxels[i]);
  }

  const Components parts = connected_components(bright, Neighbours::kCorners26);
  const std::int32_t label = parts.labels[cube.seed];
  std::vector<double> vessel = inside_of(cube, parts, label);

  if (vessel.size() < kLeastInside) {  // too thin to have an inside
    vessel.clear();
    for (std::size_t i = 0; i < bright.voxels.size(); ++i)
      if (parts.labels.voxels[i] == label) vessel.push_back(cube.grey.voxels[i]);
  }

  // Mean and deviation of the vessel; median and its deviation (Hampel 1974) of the background,
  // which may hold other vessels.
  SeedLevels out;
  const double n = static_cast<double>(vessel.size());
  out.vessel = std::accumulate(vessel.begin(), vessel.end(), 0.0) / n;
  double squares = 0;
  for (const double v : vessel) squares += (v - out.vessel) * (v - out.vessel);
  out.vessel_deviation = std::sqrt(squares / n);
  out.background = median(background);
  for (double& v : background) v = std::abs(v - out.background);
  out.background_deviation = 1.4826 * median(background);

  // The radius of a straight vessel of that volume through the cube.
  const double volume =
      static_cast<double>(parts.list[static_cast<std::size_t>(label - 1)].voxels) *
      grid.spacing_mm.prod();
  out.radius_mm = std::sqrt(volume / (2 * half_mm * std::numbers::pi));
  return out;
}

}  // namespace

std::optional<SeedLevels> levels_at(const AnyImage& image, const Voxel& seed, double sign,
                                    double smoothing_mm) {
  const ImageGrid& grid = grid_of(image);
  const double voxel = grid.spacing_mm.minCoeff();
  for (double half = kSmallestCube; half <= kLargestCube; half *= kNextCube) {
    const Cube cube = cube_around(image, seed, half * voxel, sign, smoothing_mm);
    if (cube.values.size() < kLeastVoxels) continue;
    const double threshold = otsu_threshold(cube.values);
    const auto below = std::count_if(cube.values.begin(), cube.values.end(),
                                     [&](double v) { return v < threshold; });
    if (static_cast<double>(below) < kLeastBackground * static_cast<double>(cube.values.size()))
      continue;
    if (!(cube.grey[cube.seed] >= threshold)) continue;
    return levels_in(cube, threshold, half * voxel, grid);
  }
  return std::nullopt;
}

SeedLevels median_of(const std::vector<SeedLevels>& all) {
  SeedLevels out;
  for (double SeedLevels::*field :
       {&SeedLevels::vessel, &SeedLevels::vessel_deviation, &SeedLevels::background,
        &SeedLevels::background_deviation, &SeedLevels::radius_mm}) {
    std::vector<double> values;
    for (const SeedLevels& l : all) values.push_back(l.*field);
    out.*field = median(std::move(values));
  }
  return out;
}

Voxel voxel_at(const ImageGrid& grid, const Vec3& point_mm) {
  const Vec3 at = grid.index_vox(point_mm);
  return {static_cast<int>(std::lround(at[0])), static_cast<int>(std::lround(at[1])),
          static_cast<int>(std::lround(at[2]))};
}

BrightVoxel brightest_near(const AnyImage& image, const Voxel& middle, int reach, double sign,
                           double smoothing_mm) {
  const ImageGrid& grid = grid_of(image);
  Voxel low, high;
  for (std::size_t k = 0; k < 3; ++k) {
    low[k] = std::max(0, middle[k] - reach);
    high[k] = std::min(grid.size[k] - 1, middle[k] + reach);
  }
  const Image<float> box = smoothed_box(image, low, high, smoothing_mm);
  const auto grey = [&](const Voxel& v) {
    return sign * static_cast<double>(box[{v[0] - low[0], v[1] - low[1], v[2] - low[2]}]);
  };
  BrightVoxel best{middle, grey(middle)};
  for (std::size_t i = 0; i < box.voxels.size(); ++i) {
    const Voxel u = box.grid.voxel(i);
    const Voxel v{low[0] + u[0], low[1] + u[1], low[2] + u[2]};
    if (grey(v) > best.grey) best = {v, grey(v)};
  }
  return best;
}

}  // namespace angiospline::segmentation
