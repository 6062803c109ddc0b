// The free end of a branch, taken on to where a flat cap keeps the lumen's volume.
#pragma once

#include <vector>

#include "recovery/imaging/image/image.h"

namespace angiospline {

// Points in mm with a radius each, from the inside of a vessel to its free end.
struct BranchLine {
  std::vector<Vec3> points;
  std::vector<double> radii;
};

// Follows the vessel from the last point on, section by section, while it stays as wide as it was;
// then adds the mean way to the wall over the last section's disc, so that a flat cap keeps the
// volume. Added points have the last radius. A line of one place stays as it is. Requires at least
// one point.
BranchLine extended_to_wall(const Mask& mask, BranchLine line);

}  // namespace angiospline
