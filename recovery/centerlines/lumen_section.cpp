#include "recovery/centerlines/lumen_section.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

namespace angiospline {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;

bool is_foreground(const Mask& mask, int x, int y, int z) {
  const Voxel v{x, y, z};
  return mask.grid.contains(v) && mask[v] != 0;
}

// The mask between voxel centres, trilinear.
double occupancy(const Mask& mask, const Vec3& p) {
  const int x = static_cast<int>(std::floor(p[0]));
  const int y = static_cast<int>(std::floor(p[1]));
  const int z = static_cast<int>(std::floor(p[2]));
  const double a = p[0] - x;
  const double b = p[1] - y;
  const double c = p[2] - z;
  const Voxel& n = mask.grid.size;

  // Within the image, straight from memory; at its border voxel by voxel.
  if (x >= 0 && y >= 0 && z >= 0 && x + 1 < n[0] && y + 1 < n[1] && z + 1 < n[2]) {
    const std::size_t dy = static_cast<std::size_t>(n[0]);
    const std::size_t dz = dy * static_cast<std::size_t>(n[1]);
    const std::uint8_t* v = mask.voxels.data() + mask.grid.offset({x, y, z});
    const auto along_x = [a](const std::uint8_t* pair) {
      return (pair[0] != 0 ? 1.0 - a : 0.0) + (pair[1] != 0 ? a : 0.0);
    };
    return (1.0 - c) * ((1.0 - b) * along_x(v) + b * along_x(v + dy)) +
           c * ((1.0 - b) * along_x(v + dz) + b * along_x(v + dz + dy));
  }

  double sum = 0.0;
  for (int k = 0; k < 8; ++k) {
    const int i = k & 1;
    const int j = k >> 1 & 1;
    const int l = k >> 2;
    if (is_foreground(mask, x + i, y + j, z + l))
      sum += (i ? a : 1.0 - a) * (j ? b : 1.0 - b) * (l ? c : 1.0 - c);
  }
  return sum;
}

// Walks by half voxels over the nearest voxels, which is cheap, and looks closely only at the wall.
double distance_to_wall_vox(const Mask& mask, const Vec3& from, const Vec3& step_per_mm,
                            double pace_mm, double longest_mm) {
  const auto inside = [&](double t) {
    const Vec3 p = from + t * step_per_mm;
    return is_foreground(mask, static_cast<int>(std::lround(p[0])),
                         static_cast<int>(std::lround(p[1])), static_cast<int>(std::lround(p[2])));
  };
  double t = pace_mm;
  while (t < longest_mm && inside(t)) t += pace_mm;

  // The interpolated wall lies within a voxel of the first background voxel met.
  double before = std::max(0.0, t - 3.0 * pace_mm);
  double f_before = occupancy(mask, from + before * step_per_mm);
  while (before > 0.0 && f_before < 0.5) {
    before = std::max(0.0, before - pace_mm);
    f_before = occupancy(mask, from + before * step_per_mm);
  }
  if (f_before < 0.5) return 0.0;

  const double fine = 0.5 * pace_mm;
  for (;;) {
    const double after = before + fine;
    const double f_after = occupancy(mask, from + after * step_per_mm);
    if (f_after < 0.5) return before + fine * (f_before - 0.5) / (f_before - f_after);
    if (after >= longest_mm) return longest_mm;
    before = after;
    f_before = f_after;
  }
}

}  // namespace

PlaneBasis plane_basis(const Vec3& w) {
  Eigen::Index least = 0;
  w.cwiseAbs().minCoeff(&least);
  const Vec3 u = w.cross(Vec3::Unit(least)).normalized();
  return {u, w.cross(u)};
}

double distance_to_wall_mm(const Mask& mask, const Vec3& point_mm, const Vec3& direction,
                           double longest_mm) {
  const ImageGrid& g = mask.grid;
  const Vec3 step_per_mm = (g.direction.transpose() * direction).cwiseQuotient(g.spacing_mm);
  const double pace_mm = 0.5 / step_per_mm.norm();  // half a voxel in this direction
  return std::min(longest_mm, distance_to_wall_vox(mask, g.index_vox(point_mm), step_per_mm,
                                                   pace_mm, longest_mm));
}

LumenSection lumen_section(const Mask& mask, const Vec3& point_mm, const Vec3& normal,
                           double longest_mm) {
  LumenSection section{point_mm, 0.0, false};
  if (occupancy(mask, mask.grid.index_vox(point_mm)) < 0.5) return section;
  const PlaneBasis basis = plane_basis(normal);
  Vec3 moment = Vec3::Zero();
  double squares = 0.0;
  section.closed = true;

  for (int k = 0; k < kSectionRays; ++k) {
    const double angle = 2.0 * std::numbers::pi * k / kSectionRays;
    const Vec3 direction = std::cos(angle) * basis.u + std::sin(angle) * basis.v;
    const double d = distance_to_wall_mm(mask, point_mm, direction, longest_mm);
    section.closed = section.closed && d < longest_mm;
    section.wall_mm[static_cast<std::size_t>(k)] = d;
    moment += d * direction;
    squares += d * d;
  }

  // A circle seen from a point off its centre by e: d = radius + e . direction to first order, and
  // half the mean of d^2 over the angle is its area over 2 pi wherever the point lies.
  section.center_mm = point_mm + 2.0 / kSectionRays * moment;
  section.radius_mm = std::sqrt(squares / kSectionRays);
  return section;
}

namespace {

// How far out a voxel's centre may lie in the direction of each ray: one voxel beyond the wall.
std::array<double, kSectionRays> reaches_mm(const ImageGrid& g, const LumenSection& section,
                                            const PlaneBasis& basis) {
  std::array<double, kSectionRays> out_mm;
  for (std::size_t k = 0; k < out_mm.size(); ++k) {
    const double angle = kTurn * static_cast<double>(k) / kSectionRays;
    const Vec3 direction = std::cos(angle) * basis.u + std::sin(angle) * basis.v;
    out_mm[k] = section.wall_mm[k] +
                1.0 / (g.direction.transpose() * direction).cwiseQuotient(g.spacing_mm).norm();
  }
  return out_mm;
}

// The voxels of the image that may lie in a slab about a point and within `most_mm` of its axis.
struct VoxelBox {
  Voxel low, high;
};
VoxelBox box_of_slab(const ImageGrid& g, const Vec3& point_mm, const Vec3& normal, double reach_mm,
                     double most_mm) {
  const Vec3 middle = g.index_vox(point_mm);
  const Vec3 along = (g.direction.transpose() * normal).cwiseAbs();
  VoxelBox box;
  for (int k = 0; k < 3; ++k) {
    // The slab's half-width and the disc's half-height along this axis of the image.
    const double half =
        (reach_mm * along[k] + most_mm * std::sqrt(1.0 - std::min(1.0, along[k] * along[k]))) /
        g.spacing_mm[k];
    const auto i = static_cast<std::size_t>(k);
    box.low[i] = std::max(0, static_cast<int>(std::ceil(middle[k] - half)));
    box.high[i] = std::min(g.size[i] - 1, static_cast<int>(std::floor(middle[k] + half)));
  }
  return box;
}

}  // namespace

CountedSection counted_section(const Mask& mask, const LumenSection& section, const Vec3& point_mm,
                               const Vec3& normal, double reach_mm) {
  EXPECTS(section.closed && reach_mm > 0);
  const ImageGrid& g = mask.grid;
  const PlaneBasis basis = plane_basis(normal);
  const std::array<double, kSectionRays> out_mm = reaches_mm(g, section, basis);
  double most_mm = 0.0;
  for (const double out : out_mm) most_mm = std::max(most_mm, out);
  const auto [low, high] = box_of_slab(g, point_mm, normal, reach_mm, most_mm);

  double weight = 0.0, weight_u = 0.0, weight_v = 0.0;
  for (int z = low[2]; z <= high[2]; ++z) {
    for (int y = low[1]; y <= high[1]; ++y) {
      for (int x = low[0]; x <= high[0]; ++x) {
        if (mask[{x, y, z}] == 0) continue;
        const Vec3 d = g.world_mm(Voxel{x, y, z}) - point_mm;
        const double s = d.dot(normal);
        if (std::abs(s) >= reach_mm) continue;

        // What lies beyond the wall is another vessel's.
        const double u = d.dot(basis.u), v = d.dot(basis.v);
        const double turn = std::atan2(v, u) / kTurn * kSectionRays;
        const auto ray = static_cast<std::size_t>(std::lround(turn) + kSectionRays) % kSectionRays;
        if (u * u + v * v > out_mm[ray] * out_mm[ray]) continue;

        // A raised cosine: slices come and go without a step.
        const double w = 0.5 * (1.0 + std::cos(std::numbers::pi * s / reach_mm));
        weight += w;
        weight_u += w * u;
        weight_v += w * v;
      }
    }
  }

  if (weight == 0.0) return {point_mm, 0.0};
  const double area = weight * g.spacing_mm.prod() / reach_mm;  // the cosine's integral
  return {point_mm + (weight_u * basis.u + weight_v * basis.v) / weight,
          std::sqrt(area / std::numbers::pi)};
}

}  // namespace angiospline
