// Grey values around seeds, from which segmentation chooses its parameters. Not installed.
#pragma once

#include <optional>
#include <vector>

#include "recovery/imaging/image/any_image.h"
#include "recovery/imaging/segment/segment.h"

namespace angiospline::segmentation {

// Grey values (sign * the image's, smoothed) around one voxel; none if no cube of up to 75 voxels
// to each side shows a background.
std::optional<SeedLevels> levels_at(const AnyImage& image, const Voxel& seed, double sign,
                                    double smoothing_mm);

// The median of every figure. Requires at least one.
SeedLevels median_of(const std::vector<SeedLevels>& all);

// The voxel nearest to a point; it may lie outside.
Voxel voxel_at(const ImageGrid& grid, const Vec3& point_mm);

struct BrightVoxel {
  Voxel at{0, 0, 0};
  double grey = 0;  // sign * the image's
};

// The brightest voxel of the smoothed image at most `reach` voxels beside one of its voxels; ties:
// that voxel, then the first of the image.
BrightVoxel brightest_near(const AnyImage& image, const Voxel& middle, int reach, double sign,
                           double smoothing_mm);

}  // namespace angiospline::segmentation
