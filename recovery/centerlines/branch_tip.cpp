#include "recovery/centerlines/branch_tip.h"

#include <algorithm>
#include <cmath>

#include "recovery/centerlines/lumen_section.h"
#include "recovery/centerlines/rules.h"

namespace angiospline {
namespace {

using namespace centerline_rules;

// Direction of a polyline at its end, over at least this length where it has so much.
Vec3 end_direction(const std::vector<Vec3>& points, double least_mm) {
  std::size_t k = points.size() - 1;
  while (k > 0 && (points[k] - points.back()).norm() < least_mm) --k;
  const Vec3 chord = points.back() - points[k];
  return chord.norm() > 0.0 ? chord.normalized() : Vec3(Vec3::Zero());
}

// The mean over rays that share a disc's area evenly (Vogel: A better way to construct the
// sunflower head, Mathematical Biosciences 44, 1979).
double mean_way_to_wall_mm(const Mask& mask, const Vec3& center, const Vec3& t, double radius,
                           double longest) {
  constexpr double kGoldenAngle = 2.399963229728653;  // pi (3 - sqrt 5)
  const PlaneBasis basis = plane_basis(t);
  double sum = 0.0;
  for (int ray = 0; ray < kTip.rays; ++ray) {
    const double rho = radius * std::sqrt((ray + 0.5) / kTip.rays);
    const double angle = ray * kGoldenAngle;
    const Vec3 from = center + rho * (std::cos(angle) * basis.u + std::sin(angle) * basis.v);
    sum += distance_to_wall_mm(mask, from, t, longest);
  }
  return sum / kTip.rays;
}

}  // namespace

BranchLine extended_to_wall(const Mask& mask, BranchLine line) {
  std::vector<Vec3>& points = line.points;
  std::vector<double>& radii = line.radii;
  const double radius = radii.back();
  const double pace = mask.grid.spacing_mm.minCoeff();
  const double voxel_mm = mask.grid.spacing_mm.maxCoeff();
  const double longest = kTip.longest_radii * radius + kTip.longest_voxels * voxel_mm;
  const double over = std::max(radius, kTip.direction_voxels * voxel_mm);
  Vec3 t = end_direction(points, over);
  if (t.isZero()) return line;

  // Section by section, while it stays as wide as it was. A tail was cut by half of that at most.
  const double most = kTip.farthest_radii * radius + kTip.farthest_voxels * voxel_mm;
  for (double gone = 0.0; gone < most; gone += pace) {
    const Vec3 next = points.back() + pace * t;
    const LumenSection s = lumen_section(mask, next, t, longest);
    if (!s.closed || s.radius_mm < kTip.full_section * radius ||
        s.radius_mm * kTip.full_section > radius) {
      break;
    }
    const Vec3 shift = s.center_mm - next;
    points.push_back(
        next + std::min(1.0, kTip.most_shift * pace / std::max(shift.norm(), 1e-3 * pace)) * shift);
    radii.push_back(radius);
    t = end_direction(points, over);
  }

  // The cap's volume: a flat one at the mean way to the wall holds as much.
  const Vec3 tip = points.back();
  const double length = mean_way_to_wall_mm(mask, tip, t, radius, longest);
  const int steps = static_cast<int>(std::ceil(length / pace));
  for (int i = 1; i <= steps; ++i) {
    points.push_back(tip + length * i / steps * t);
    radii.push_back(radius);
  }
  return line;
}

}  // namespace angiospline
