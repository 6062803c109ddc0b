#include "recovery/imaging/rasterize/shapes.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace angiospline {
namespace {

constexpr int kSamples = 4;     // along each axis; 64 samples are one word
constexpr int kSlabSlices = 8;  // bounds the memory for the words

struct VoxelBox {
  Voxel low, high;
};

VoxelBox voxels_of(const Shape& shape, const ImageGrid& grid) {
  VoxelBox box;
  for (int i = 0; i < 3; ++i) {
    const auto k = static_cast<std::size_t>(i);
    box.low[k] = std::max(0, static_cast<int>(std::floor(shape.low_mm[i] / grid.spacing_mm[i])));
    box.high[k] = std::min(grid.size[k] - 1,
                           static_cast<int>(std::ceil(shape.high_mm[i] / grid.spacing_mm[i])));
  }
  return box;
}

std::uint64_t samples_inside(const Shape& shape, const Vec3& centre, const Vec3& spacing) {
  std::uint64_t bits = 0;
  int k = 0;
  for (int z = 0; z < kSamples; ++z)
    for (int y = 0; y < kSamples; ++y)
      for (int x = 0; x < kSamples; ++x, ++k) {
        const Vec3 offset = (Vec3(x, y, z).array() + 0.5) / kSamples - 0.5;
        if (shape.inside(centre + spacing.cwiseProduct(offset)) < 0) bits |= std::uint64_t{1} << k;
      }
  return bits;
}

}  // namespace

Shape round_cone(const Vec3& a, double ra, const Vec3& b, double rb) {
  Shape s;
  s.low_mm = (a.array() - ra).min(b.array() - rb);
  s.high_mm = (a.array() + ra).max(b.array() + rb);

  const Vec3 ab = b - a;
  const double length_squared = ab.squaredNorm(), dr = ra - rb;
  if (length_squared <= dr * dr) {  // one ball holds the other
    const Vec3 c = ra >= rb ? a : b;
    const double r = std::max(ra, rb);
    s.inside = [c, r](const Vec3& p) { return (p - c).norm() - r; };
    return s;
  }

  // Quilez, "Round cone": the flank is a cone tangent to both balls; `lean` shifts the foot point.
  const double flank = std::sqrt(length_squared - dr * dr);
  const double length = std::sqrt(length_squared);
  s.inside = [=](const Vec3& p) {
    const Vec3 ap = p - a;
    const double along = ap.dot(ab) / length;
    const double off = std::sqrt(std::max(0.0, ap.squaredNorm() - along * along));
    const double foot =
        along - off * dr / flank;  // where the flank's normal through p meets the axis
    if (foot <= 0) return ap.norm() - ra;
    if (foot >= length) return (p - b).norm() - rb;
    return (off * flank + along * dr) / length - ra;
  };
  return s;
}

Shape torus(const Vec3& centre, const Vec3& axis, double ring_radius, double tube_radius) {
  Shape s;
  for (int i = 0; i < 3; ++i) {
    const double reach =
        ring_radius * std::sqrt(std::max(0.0, 1 - axis[i] * axis[i])) + tube_radius;
    s.low_mm[i] = centre[i] - reach;
    s.high_mm[i] = centre[i] + reach;
  }
  s.inside = [=](const Vec3& p) {
    const double height = axis.dot(p - centre);
    const double off = std::sqrt(std::max(0.0, (p - centre).squaredNorm() - height * height));
    return std::hypot(off - ring_radius, height) - tube_radius;
  };
  return s;
}

Shape flat_cylinder(const Vec3& a, const Vec3& b, double radius) {
  Shape s;
  s.low_mm = a.cwiseMin(b).array() - radius;
  s.high_mm = a.cwiseMax(b).array() + radius;
  const Vec3 middle = (a + b) / 2, axis = (b - a).normalized();
  const double half = (b - a).norm() / 2;
  s.inside = [=](const Vec3& p) {
    const double along = axis.dot(p - middle);
    const double off = std::sqrt(std::max(0.0, (p - middle).squaredNorm() - along * along));
    const double side = off - radius, end = std::abs(along) - half;
    return std::min(std::max(side, end), 0.0) + std::hypot(std::max(side, 0.0), std::max(end, 0.0));
  };
  return s;
}

Image<float> coverage(const ImageGrid& grid, const std::vector<Shape>& shapes) {
  Image<float> out(grid);
  std::vector<VoxelBox> boxes;
  for (const Shape& s : shapes) boxes.push_back(voxels_of(s, grid));

  // A voxel whose centre is farther from the surface than its diagonal's half is all in or all out.
  const double half_diagonal = grid.spacing_mm.norm() / 2;
  const std::size_t slice = grid.offset({0, 0, 1});
  std::vector<std::uint64_t> filled;

  for (int z0 = 0; z0 < grid.size[2]; z0 += kSlabSlices) {
    const int z1 = std::min(z0 + kSlabSlices, grid.size[2]);
    filled.assign(slice * static_cast<std::size_t>(z1 - z0), 0);
    for (std::size_t k = 0; k < shapes.size(); ++k) {
      const VoxelBox& box = boxes[k];
      const double band = shapes[k].steepness * half_diagonal;
      for (int z = std::max(z0, box.low[2]); z <= std::min(z1 - 1, box.high[2]); ++z)
        for (int y = box.low[1]; y <= box.high[1]; ++y)
          for (int x = box.low[0]; x <= box.high[0]; ++x) {
            std::uint64_t& bits = filled[grid.offset({x, y, z - z0})];
            if (bits == ~std::uint64_t{0}) continue;
            const Vec3 centre = grid.spacing_mm.cwiseProduct(Vec3(x, y, z));
            const double distance = shapes[k].inside(centre);
            if (distance > band) continue;
            bits |= distance < -band ? ~std::uint64_t{0}
                                     : samples_inside(shapes[k], centre, grid.spacing_mm);
          }
    }

    for (std::size_t i = 0; i < filled.size(); ++i)
      out.voxels[slice * static_cast<std::size_t>(z0) + i] =
          static_cast<float>(std::popcount(filled[i])) / 64.0F;
  }
  return out;
}

}  // namespace angiospline
