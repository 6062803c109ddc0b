// X-ray projections of divergent geometry: a point source and a flat detector.
#pragma once

#include <optional>

#include "base/result.h"
#include "recovery/imaging/image/image.h"

namespace angiospline {

struct XrayGeometry {
  Vec3 source_mm = Vec3::Zero();
  Vec3 first_pixel_mm = Vec3::Zero();  // centre of pixel (0, 0)
  Vec3 column_axis = Vec3::UnitX();    // unit vectors along which the pixel's first and second
  Vec3 row_axis = Vec3::UnitY();       // index grow
  Vec2 pixel_mm = Vec2::Ones();        // pixel pitch along both
  std::array<int, 2> size{0, 0};       // columns, rows

  // Column and row (not rounded) where the ray from the source through a point meets the detector;
  // none if the point is at the source, beside it, or behind it. May lie outside the detector.
  std::optional<Vec2> project(const Vec3& point_mm) const;
};

// A C-arm that turns about the y axis through `centre_mm`: at angle 0 the source lies in front of
// the centre (towards -z), the detector behind it; rows run along y. The detector is centred and
// perpendicular to the central ray. Requires positive distances, size and pixel.
struct CArm {
  Vec3 centre_mm = Vec3::Zero();
  double angle_deg = 0;
  double source_to_centre_mm = 750;
  double source_to_detector_mm = 1000;
  double pixel_mm = 1;
  int pixels = 256;  // along both edges
};
XrayGeometry c_arm_geometry(const CArm& arm);

struct XrayView {
  XrayGeometry geometry;
  Image<float> image;  // size (columns, rows, 1); vessels bright, as in subtraction angiography
};

// The view of a volume of densities: 1 - exp(-attenuation * path integral of the density in mm),
// sampled along each ray at half the smallest voxel edge with trilinear interpolation; a density is
// 0 outside the volume. White Gaussian noise of deviation 1 / snr is added if snr is given.
Image<float> project_volume(const Image<float>& density, const XrayGeometry& geometry,
                            double attenuation_per_mm, std::optional<double> snr,
                            std::uint64_t seed = 1);

}  // namespace angiospline
