// What lies behind a neck of a mask and is much thicker than the vessel before it.
#pragma once

#include <cstddef>
#include <optional>

#include "recovery/imaging/image/image.h"

namespace angiospline {

// Tissue without a hole into which growing leaked, or a wider vessel reached through a stenosis.
struct Swelling {
  Voxel neck{0, 0, 0};         // where it meets the vessel
  double grey = 0;             // to which the front had gone down when it broke through
  double vessel_depth_mm = 0;  // largest distance to the wall on the seeds' side
  double beyond_depth_mm = 0;  // and behind the neck
  std::size_t voxels = 0;      // behind the neck
  bool cut = false;
};

struct SwellingParts {
  Swelling swelling;
  Mask vessel;  // the mask without the swelling
};

// `before` is the part of `mask` that was vessel before the front broke through; both on one grid.
// The core of a swelling is what lies at least `times` as deep as the deepest place of `before`;
// each voxel of the mask then belongs to the vessel or to the swelling, whichever is nearer in
// steps to one of 26 neighbours within the mask (ties: the vessel). None if nothing is so deep.
// Time: the distances to the wall, and a walk over the mask.
std::optional<SwellingParts> find_swelling(const Mask& mask, Mask before, double times = 2.5);

}  // namespace angiospline
