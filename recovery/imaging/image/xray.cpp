#include "recovery/imaging/image/xray.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Dense>
#include <tbb/parallel_for.h>

#include "base/random.h"

namespace angiospline {
namespace {

// Trilinear interpolation; 0 outside.
double value_at(const Image<float>& image, const Vec3& index) {
  Voxel low;
  Vec3 t;
  for (int i = 0; i < 3; ++i) {
    const double floor = std::floor(index[i]);
    low[static_cast<std::size_t>(i)] = static_cast<int>(floor);
    t[i] = index[i] - floor;
  }
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    Voxel v = low;
    double weight = 1;
    for (int i = 0; i < 3; ++i) {
      const bool up = corner >> i & 1;
      v[static_cast<std::size_t>(i)] += up;
      weight *= up ? t[i] : 1 - t[i];
    }
    if (weight > 0 && image.grid.contains(v)) sum += weight * static_cast<double>(image[v]);
  }
  return sum;
}

// Where a ray (in voxels) is inside the volume: parameters of entry and exit; empty if it misses.
std::pair<double, double> clip(const Vec3& from, const Vec3& to, const Voxel& size) {
  double enter = 0, leave = 1;
  for (int i = 0; i < 3; ++i) {
    const double low = -1, high = size[static_cast<std::size_t>(i)];
    const double step = to[i] - from[i];
    if (step == 0) {
      if (from[i] < low || from[i] > high) return {1, 0};
      continue;
    }
    const double a = (low - from[i]) / step, b = (high - from[i]) / step;
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  return {enter, leave};
}

}  // namespace

std::optional<Vec2> XrayGeometry::project(const Vec3& point_mm) const {
  const Vec3 normal = column_axis.cross(row_axis);
  const Vec3 ray = point_mm - source_mm;
  const double reach = normal.dot(first_pixel_mm - source_mm), along = normal.dot(ray);
  if (reach == 0 || along == 0 || along / reach <= 0) return std::nullopt;
  const Vec3 hit = source_mm + ray * (reach / along) - first_pixel_mm;
  return Vec2(hit.dot(column_axis) / pixel_mm[0], hit.dot(row_axis) / pixel_mm[1]);
}

XrayGeometry c_arm_geometry(const CArm& arm) {
  EXPECTS(arm.source_to_centre_mm > 0 && arm.source_to_detector_mm > 0 && arm.pixel_mm > 0 &&
          arm.pixels > 0);
  const double angle = arm.angle_deg * std::numbers::pi / 180;
  const Vec3 ahead(std::sin(angle), 0, std::cos(angle));  // from the source to the centre
  XrayGeometry g;
  g.source_mm = arm.centre_mm - arm.source_to_centre_mm * ahead;
  g.row_axis = Vec3::UnitY();
  g.column_axis = Vec3(std::cos(angle), 0, -std::sin(angle));
  g.pixel_mm = Vec2::Constant(arm.pixel_mm);
  g.size = {arm.pixels, arm.pixels};
  g.first_pixel_mm = g.source_mm + arm.source_to_detector_mm * ahead -
                     (arm.pixels - 1) / 2.0 * arm.pixel_mm * (g.column_axis + g.row_axis);
  return g;
}

Image<float> project_volume(const Image<float>& density, const XrayGeometry& geometry,
                            double attenuation_per_mm, std::optional<double> snr,
                            std::uint64_t seed) {
  Image<float> out;
  out.grid.size = {geometry.size[0], geometry.size[1], 1};
  out.grid.spacing_mm = Vec3(geometry.pixel_mm[0], geometry.pixel_mm[1], 1);
  out.voxels.assign(out.grid.voxel_count(), 0);

  // Beer and Lambert: what a ray loses is the exponential of the density along it, by midpoints.
  const double step_mm = density.grid.spacing_mm.minCoeff() / 2;
  const Vec3 source = density.grid.index_vox(geometry.source_mm);
  tbb::parallel_for(0, geometry.size[1], [&](int row) {
    for (int column = 0; column < geometry.size[0]; ++column) {
      const Vec3 pixel = geometry.first_pixel_mm +
                         column * geometry.pixel_mm[0] * geometry.column_axis +
                         row * geometry.pixel_mm[1] * geometry.row_axis;
      const Vec3 target = density.grid.index_vox(pixel);

      const auto [enter, leave] = clip(source, target, density.grid.size);
      if (enter >= leave) continue;
      const double length = (pixel - geometry.source_mm).norm();
      const int samples = std::max(1, static_cast<int>((leave - enter) * length / step_mm));

      double sum = 0;
      for (int k = 0; k < samples; ++k) {
        const double t = enter + (leave - enter) * (k + 0.5) / samples;
        sum += value_at(density, source + t * (target - source));
      }
      const double path_mm = sum * (leave - enter) * length / samples;
      out[{column, row, 0}] = static_cast<float>(1 - std::exp(-attenuation_per_mm * path_mm));
    }
  });

  if (snr) {
    Random random(seed);
    for (float& v : out.voxels) v += static_cast<float>(random.gaussian() / *snr);
  }
  return out;
}

}  // namespace angiospline
