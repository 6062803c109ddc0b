#include "recovery/imaging/mask/tunnels.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "recovery/imaging/mask/distance_transform.h"
#include "recovery/imaging/mask/foreground.h"
#include "recovery/imaging/mask/morphology.h"
#include "recovery/imaging/mask/neighborhood.h"
#include "recovery/imaging/mask/topology_numbers.h"

namespace angiospline {
namespace {

// What a voxel of the mask means while tunnels are looked for.
enum Mark : std::uint8_t { kBackground = 0, kForeground = 1, kGrown = 2, kClosed = 3, kTaken = 4 };

std::vector<Voxel> ball(double radius_mm, const Vec3& spacing_mm) {
  std::vector<Voxel> out;
  const Vec3 reach = (radius_mm / spacing_mm.array()).floor();
  const auto n = [&](int k) { return static_cast<int>(reach[k]); };
  for (int z = -n(2); z <= n(2); ++z)
    for (int y = -n(1); y <= n(1); ++y)
      for (int x = -n(0); x <= n(0); ++x)
        if (spacing_mm.cwiseProduct(Vec3(x, y, z)).norm() <= radius_mm) out.push_back({x, y, z});
  return out;
}

Voxel sum(const Voxel& a, const Voxel& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }

// Offsets of background voxels that a closing by the ball would add, in growing order. What lies
// outside the image is background, so that nothing is added to what the border cuts.
class Closing {
 public:
  Closing(Mask& mask, double radius_mm)
      : mask_(mask), ball_(ball(radius_mm, mask.grid.spacing_mm)) {}

  std::vector<std::size_t> added() {
    const std::vector<std::size_t> grown = grow();
    std::vector<std::size_t> out;
    for (const std::size_t g : grown) {
      const Voxel v = mask_.grid.voxel(g);
      const bool stays = std::all_of(ball_.begin(), ball_.end(), [&](const Voxel& b) {
        const Voxel u = sum(v, b);
        return mask_.grid.contains(u) && mask_[u] != kBackground;
      });
      if (stays) out.push_back(g);
    }
    for (const std::size_t g : grown) mask_.voxels[g] = kBackground;
    return out;
  }

 private:
  std::vector<std::size_t> grow() {
    std::vector<std::size_t> grown;
    for (const std::size_t f : foreground_offsets(mask_)) {
      const Voxel v = mask_.grid.voxel(f);
      if (!on_surface(v)) continue;
      for (const Voxel& b : ball_) {
        const Voxel u = sum(v, b);
        if (!mask_.grid.contains(u) || mask_[u] != kBackground) continue;
        mask_[u] = kGrown;
        grown.push_back(mask_.grid.offset(u));
      }
    }
    std::sort(grown.begin(), grown.end());
    return grown;
  }

  bool on_surface(const Voxel& v) const {
    for (std::size_t k = 0; k < 3; ++k)
      for (const int step : {-1, 1}) {
        Voxel u = v;
        u[k] += step;
        if (mask_.grid.contains(u) && mask_[u] == kBackground) return true;
      }
    return false;
  }

  Mask& mask_;
  std::vector<Voxel> ball_;
};

// The listed voxels in 26-connected groups.
std::vector<std::vector<std::size_t>> groups_of(Mask& mask,
                                                const std::vector<std::size_t>& offsets) {
  for (const std::size_t o : offsets) mask.voxels[o] = kClosed;
  std::vector<std::vector<std::size_t>> groups;
  for (const std::size_t o : offsets) {
    if (mask.voxels[o] != kClosed) continue;
    std::vector<std::size_t> group{o};
    mask.voxels[o] = kTaken;
    for (std::size_t k = 0; k < group.size(); ++k) {
      const Voxel v = mask.grid.voxel(group[k]);
      for (int n = 0; n < 27; ++n) {
        const Voxel u = sum(v, {n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1});
        if (!mask.grid.contains(u) || mask[u] != kClosed) continue;
        mask[u] = kTaken;
        group.push_back(mask.grid.offset(u));
      }
    }
    groups.push_back(std::move(group));
  }
  for (const std::size_t o : offsets) mask.voxels[o] = kBackground;
  return groups;
}

// By how much the Euler characteristic rises when the group becomes foreground: a sum over the
// windows that hold one of its voxels, so that a box around it tells.
std::int64_t euler_gain(const Mask& mask, const std::vector<std::size_t>& group) {
  Voxel low = mask.grid.voxel(group[0]), high = low;
  for (const std::size_t o : group) {
    const Voxel v = mask.grid.voxel(o);
    for (std::size_t k = 0; k < 3; ++k)
      low[k] = std::min(low[k], v[k]), high[k] = std::max(high[k], v[k]);
  }

  Mask box;
  for (std::size_t k = 0; k < 3; ++k) {
    low[k] = std::max(0, low[k] - 1);
    high[k] = std::min(mask.grid.size[k] - 1, high[k] + 1);
    box.grid.size[k] = high[k] - low[k] + 1;
  }
  box.voxels.reserve(box.grid.voxel_count());
  for (int z = low[2]; z <= high[2]; ++z)
    for (int y = low[1]; y <= high[1]; ++y)
      for (int x = low[0]; x <= high[0]; ++x) box.voxels.push_back(mask[{x, y, z}] != 0 ? 1 : 0);

  const std::int64_t before = topology_numbers(box).euler;
  for (const std::size_t o : group) {
    const Voxel v = mask.grid.voxel(o);
    box[{v[0] - low[0], v[1] - low[1], v[2] - low[2]}] = 1;
  }
  return topology_numbers(box).euler - before;
}

// Whether the group, which is foreground for the asking, lies deep enough for a tunnel that wide.
bool deep_enough(const Mask& mask, const std::vector<std::size_t>& group, double least_mm) {
  const std::vector<double> depth = boundary_distances_mm(mask, group);
  return *std::max_element(depth.begin(), depth.end()) >= least_mm;
}

}  // namespace

Result<ClosedTunnels> close_tunnels(Mask mask, const TunnelOptions& options,
                                    const Progress& progress) {
  ClosedTunnels out;
  out.topology = topology_numbers(mask);
  const std::int64_t loops = out.topology.cycles;
  out.mask = std::move(mask);
  if (loops == 0 || loops > kMostTunnels) return out;
  for (std::uint8_t& v : out.mask.voxels) v = v != 0 ? kForeground : kBackground;

  // Wider and wider closings; what fills a loop stays filled if it is narrow, or deep for its
  // width.
  const double edge_mm = std::cbrt(out.mask.grid.spacing_mm.prod());
  for (double width = 1; width <= options.most_voxels; width += 0.5) {
    if (progress.should_stop()) return fail(cancelled("close tunnels"));
    const double radius_mm = width * edge_mm;
    for (const auto& group : groups_of(out.mask, Closing(out.mask, radius_mm).added())) {
      if (euler_gain(out.mask, group) <= 0) continue;
      for (const std::size_t o : group) out.mask.voxels[o] = kForeground;
      if (width <= options.voxels ||
          deep_enough(out.mask, group, radius_mm / options.lumen_share)) {
        out.voxels += group.size();
      } else {
        for (const std::size_t o : group) out.mask.voxels[o] = kBackground;
      }
    }
  }

  Filled cavities = fill_cavities(std::move(out.mask));
  out.mask = std::move(cavities.mask);
  out.voxels += cavities.voxels;
  out.topology = topology_numbers(out.mask);
  out.tunnels = static_cast<std::size_t>(std::max<std::int64_t>(0, loops - out.topology.cycles));
  return out;
}

}  // namespace angiospline
