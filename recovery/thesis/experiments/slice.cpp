#include "recovery/thesis/experiments/slice.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/random.h"
#include "recovery/imaging/rasterize/shapes.h"

namespace angiospline {
namespace {

struct Blob {
  Vec3 centre;
  double radius, second, third, phase;  // and the harmonics of its outline, as shares of the radius
};

Shape shape_of(const Blob& b) {
  Shape s;
  const double reach = 1.3 * b.radius;
  s.low_mm = b.centre - Vec3(reach, reach, 1);
  s.high_mm = b.centre + Vec3(reach, reach, 1);
  s.inside = [b](const Vec3& p) {
    const double x = p[0] - b.centre[0], y = p[1] - b.centre[1];
    const double a = std::atan2(y, x) - b.phase;
    return std::hypot(x, y) -
           b.radius * (1 + b.second * std::cos(2 * a) + b.third * std::cos(3 * a));
  };
  s.steepness = 1.5;
  return s;
}

SliceArtery artery(const ImageGrid& grid, const Blob& blob, const Image<float>& filled) {
  SliceArtery out{Mask(grid), blob.centre, blob.radius};
  for (std::size_t i = 0; i < filled.voxels.size(); ++i)
    out.truth.voxels[i] = filled.voxels[i] >= 0.5F;
  return out;
}

}  // namespace

ArterySlice artery_slice(double snr, std::uint64_t seed) {
  EXPECTS(snr > 0);
  ImageGrid grid;
  grid.size = {64, 64, 1};
  // Radii whose outlines hold 122 and 158 square millimetres.
  const Blob right{{19.3, 30.6, 0}, 6.22, 0.05, 0.03, 0.4};
  const Blob left{{43.8, 31.4, 0}, 7.08, 0.07, 0.03, 1.1};
  const Blob vein{{55.5, 37.5, 0}, 2.6, 0.1, 0.0, 0.2};
  const Image<float> a = coverage(grid, {shape_of(right)}), b = coverage(grid, {shape_of(left)}),
                     c = coverage(grid, {shape_of(vein)});
  ArterySlice out{Image<std::int16_t>(grid), artery(grid, right, a), artery(grid, left, b)};
  Random random(seed);
  for (std::size_t i = 0; i < out.image.voxels.size(); ++i) {
    const auto filled =
        static_cast<double>(std::max({a.voxels[i], b.voxels[i], 0.7F * c.voxels[i]}));
    out.image.voxels[i] = static_cast<std::int16_t>(
        std::lround(200 + 1000 * filled + 1000 / snr * random.gaussian()));
  }
  return out;
}

}  // namespace angiospline
