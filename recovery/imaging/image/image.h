// A volume image: the only type that knows voxels.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/contract.h"
#include "base/vector.h"

namespace angiospline {

using Voxel = std::array<int, 3>;

// The grid of an image in the LPS world: world = origin + direction * (spacing .* index); the
// centre of voxel (0, 0, 0) is the origin. The columns of `direction` are orthonormal.
struct ImageGrid {
  Voxel size{0, 0, 0};
  Vec3 spacing_mm = Vec3::Ones();
  Vec3 origin_mm = Vec3::Zero();
  Mat3 direction = Mat3::Identity();

  std::size_t voxel_count() const {
    return static_cast<std::size_t>(size[0]) * static_cast<std::size_t>(size[1]) *
           static_cast<std::size_t>(size[2]);
  }
  bool contains(const Voxel& v) const {
    return v[0] >= 0 && v[1] >= 0 && v[2] >= 0 && v[0] < size[0] && v[1] < size[1] &&
           v[2] < size[2];
  }
  std::size_t offset(const Voxel& v) const {  // x fastest
    return static_cast<std::size_t>(v[0]) +
           static_cast<std::size_t>(size[0]) *
               (static_cast<std::size_t>(v[1]) +
                static_cast<std::size_t>(size[1]) * static_cast<std::size_t>(v[2]));
  }
  Voxel voxel(std::size_t offset) const {
    const auto nx = static_cast<std::size_t>(size[0]);
    const auto ny = static_cast<std::size_t>(size[1]);
    return {static_cast<int>(offset % nx), static_cast<int>(offset / nx % ny),
            static_cast<int>(offset / (nx * ny))};
  }
  Vec3 world_mm(const Vec3& index_vox) const {
    return origin_mm + direction * spacing_mm.cwiseProduct(index_vox);
  }
  Vec3 world_mm(const Voxel& v) const { return world_mm(Vec3(v[0], v[1], v[2])); }
  Vec3 index_vox(const Vec3& point_mm) const {
    return (direction.transpose() * (point_mm - origin_mm)).cwiseQuotient(spacing_mm);
  }
};

// Voxel values on a grid, x fastest.
template <typename T>
struct Image {
  ImageGrid grid;
  std::vector<T> voxels;

  Image() = default;
  explicit Image(const ImageGrid& g, T value = T{}) : grid(g), voxels(g.voxel_count(), value) {}

  T& operator[](const Voxel& v) { return voxels[grid.offset(v)]; }
  const T& operator[](const Voxel& v) const { return voxels[grid.offset(v)]; }
};

using Mask = Image<std::uint8_t>;  // 0 background, anything else foreground

}  // namespace angiospline
