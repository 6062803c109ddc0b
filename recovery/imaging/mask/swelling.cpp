#include "recovery/imaging/mask/swelling.h"

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "recovery/imaging/mask/distance_transform.h"
#include "recovery/imaging/mask/foreground.h"
#include "recovery/imaging/mask/neighborhood.h"

namespace angiospline {
namespace {

constexpr std::uint8_t kVessel = 1, kSwelling = 2;

template <typename F>
void for_neighbors(const ImageGrid& grid, std::size_t offset, F&& f) {
  const Voxel v = grid.voxel(offset);
  for (const Voxel& d : kNeighbors) {
    const Voxel u{v[0] + d[0], v[1] + d[1], v[2] + d[2]};
    if (grid.contains(u)) f(grid.offset(u));
  }
}

// Spreads the marks over the mask, a layer of neighbours at a time, vessel first.
void spread(const Mask& mask, Mask& marks, std::vector<std::size_t> vessel,
            std::vector<std::size_t> swelling) {
  while (!vessel.empty() || !swelling.empty())
    for (auto* front : {&vessel, &swelling}) {
      std::vector<std::size_t> next;
      for (const std::size_t at : *front)
        for_neighbors(mask.grid, at, [&](std::size_t u) {
          if (mask.voxels[u] == 0 || marks.voxels[u] != 0) return;
          marks.voxels[u] = marks.voxels[at];
          next.push_back(u);
        });
      *front = std::move(next);
    }
}

// The vessel's voxel beside the swelling that is nearest to the middle of all such.
Voxel neck_of(const Mask& marks, const std::vector<std::size_t>& offsets) {
  std::vector<Voxel> rim;
  Vec3 sum = Vec3::Zero();
  for (const std::size_t at : offsets) {
    if (marks.voxels[at] != kVessel) continue;
    bool touches = false;
    for_neighbors(marks.grid, at,
                  [&](std::size_t u) { touches = touches || marks.voxels[u] == kSwelling; });
    if (!touches) continue;
    rim.push_back(marks.grid.voxel(at));
    sum += Vec3(rim.back()[0], rim.back()[1], rim.back()[2]);
  }
  if (rim.empty()) return {0, 0, 0};
  const Vec3 middle = sum / static_cast<double>(rim.size());
  return *std::min_element(rim.begin(), rim.end(), [&](const Voxel& a, const Voxel& b) {
    return (Vec3(a[0], a[1], a[2]) - middle).squaredNorm() <
           (Vec3(b[0], b[1], b[2]) - middle).squaredNorm();
  });
}

}  // namespace

std::optional<SwellingParts> find_swelling(const Mask& mask, Mask before, double times) {
  EXPECTS(mask.grid.size == before.grid.size && times > 1);
  const ForegroundDistances depth_mm(mask);
  const std::vector<std::size_t> offsets = foreground_offsets(mask);
  SwellingParts parts;
  Swelling& s = parts.swelling;

  std::vector<std::size_t> vessel, core;
  for (const std::size_t at : offsets) {
    const bool is_vessel = before.voxels[at] != 0;
    double& deepest = is_vessel ? s.vessel_depth_mm : s.beyond_depth_mm;
    deepest = std::max(deepest, depth_mm.at_mm(at));
    before.voxels[at] = is_vessel ? kVessel : 0;
    if (is_vessel) vessel.push_back(at);
  }

  if (vessel.empty() || s.beyond_depth_mm < times * s.vessel_depth_mm) return std::nullopt;
  for (const std::size_t at : offsets)
    if (before.voxels[at] == 0 && depth_mm.at_mm(at) >= times * s.vessel_depth_mm) {
      before.voxels[at] = kSwelling;
      core.push_back(at);
    }

  spread(mask, before, std::move(vessel), std::move(core));
  s.neck = neck_of(before, offsets);

  parts.vessel = mask;
  for (const std::size_t at : offsets)
    if (before.voxels[at] == kSwelling) {
      parts.vessel.voxels[at] = 0;
      ++s.voxels;
    }
  return parts;
}

}  // namespace angiospline
