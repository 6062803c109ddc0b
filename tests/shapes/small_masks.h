// Masks for the tests of this folder: noise, tubes, trees with a known graph, turned copies.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "base/random.h"
#include "recovery/imaging/image/image.h"

namespace angiospline::test {

inline Mask empty_mask(Voxel size, Vec3 spacing_mm = Vec3::Ones()) {
  ImageGrid grid;
  grid.size = size;
  grid.spacing_mm = spacing_mm;
  return Mask(grid);
}

inline Mask mask_of(Voxel size, const std::vector<Voxel>& voxels) {
  Mask mask = empty_mask(size);
  for (const Voxel& v : voxels) mask[v] = 1;
  return mask;
}

inline Mask noise_mask(Voxel size, double density, Random& random) {
  Mask mask = empty_mask(size);
  for (auto& v : mask.voxels) v = random.uniform() < density ? 1 : 0;
  return mask;
}

// Noise smoothed by a running box: blobs, tunnels and cavities of some voxels.
inline Mask blob_mask(Voxel size, double density, Random& random) {
  Mask mask = noise_mask(size, density, random);
  Mask out = mask;
  for (int z = 0; z < size[2]; ++z)
    for (int y = 0; y < size[1]; ++y)
      for (int x = 0; x < size[0]; ++x) {
        int sum = 0;
        int count = 0;
        for (int c = -1; c <= 1; ++c)
          for (int b = -1; b <= 1; ++b)
            for (int a = -1; a <= 1; ++a) {
              const Voxel u{x + a, y + b, z + c};
              if (!mask.grid.contains(u)) continue;
              sum += mask[u];
              ++count;
            }
        out[{x, y, z}] = 2 * sum > count ? 1 : 0;
      }
  return out;
}

// Adds the voxels whose centres lie within `radius_mm` of the segment a b; flat ends lie at a and
// b.
enum class Ends { kRound, kFlat };
inline void add_tube(Mask& mask, const Vec3& a_mm, const Vec3& b_mm, double radius_mm,
                     Ends ends = Ends::kRound) {
  const ImageGrid& g = mask.grid;
  Voxel low{};
  Voxel high{};
  for (int k = 0; k < 3; ++k) {
    const double lo = (std::min(a_mm[k], b_mm[k]) - radius_mm - g.origin_mm[k]) / g.spacing_mm[k];
    const double hi = (std::max(a_mm[k], b_mm[k]) + radius_mm - g.origin_mm[k]) / g.spacing_mm[k];
    const auto i = static_cast<std::size_t>(k);
    low[i] = std::max(0, static_cast<int>(std::floor(lo)));
    high[i] = std::min(g.size[i] - 1, static_cast<int>(std::ceil(hi)));
  }
  const Vec3 axis = b_mm - a_mm;
  const double length2 = axis.squaredNorm();
  for (int z = low[2]; z <= high[2]; ++z)
    for (int y = low[1]; y <= high[1]; ++y)
      for (int x = low[0]; x <= high[0]; ++x) {
        const Vec3 p = g.world_mm(Voxel{x, y, z});
        double s = length2 > 0.0 ? (p - a_mm).dot(axis) / length2 : 0.0;
        if (ends == Ends::kFlat && (s < 0.0 || s > 1.0)) continue;
        s = std::clamp(s, 0.0, 1.0);
        if ((p - a_mm - s * axis).squaredNorm() <= radius_mm * radius_mm) mask[{x, y, z}] = 1;
      }
}

// The mask with its axes permuted and some of them mirrored: voxel[k] of the result is
// voxel[axes[k]] of the original. All 48 rotations and reflections of the grid.
inline Mask turned(const Mask& mask, std::array<int, 3> axes, std::array<bool, 3> mirrored) {
  Mask out;
  for (std::size_t k = 0; k < 3; ++k) {
    out.grid.size[k] = mask.grid.size[static_cast<std::size_t>(axes[k])];
    out.grid.spacing_mm[static_cast<int>(k)] = mask.grid.spacing_mm[axes[k]];
  }
  out.voxels.resize(mask.voxels.size());
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) {
    const Voxel v = mask.grid.voxel(i);
    Voxel u{};
    for (std::size_t k = 0; k < 3; ++k) {
      const int c = v[static_cast<std::size_t>(axes[k])];
      u[k] = mirrored[k] ? out.grid.size[k] - 1 - c : c;
    }
    out[u] = mask.voxels[i];
  }
  return out;
}

// Three linked rings, each in a plane of the axes through the centre: 6 crossings, 12 quarters.
inline Mask rings_mask(int n, double radius_vox, double tube_vox) {
  Mask mask = empty_mask({n, n, n});
  const double c = (n - 1) / 2.0;
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) {
    const Voxel v = mask.grid.voxel(i);
    const Vec3 p(v[0] - c, v[1] - c, v[2] - c);
    for (int axis = 0; axis < 3; ++axis) {
      const double h = p[axis];
      const double ring = std::sqrt(p.squaredNorm() - h * h) - radius_vox;
      if (h * h + ring * ring <= tube_vox * tube_vox) mask.voxels[i] = 1;
    }
  }
  return mask;
}

}  // namespace angiospline::test
