// A junction, or a closed surface, moved to where the wall is, with common tangent planes still.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "recovery/fit/patches.h"
#include "recovery/fit/rings.h"

namespace angiospline {

struct MovedPatches {
  std::map<int, Vec3> points;  // new places of pool columns
  double share = 0.0;          // of the way that it went; 0: it has to stay
  std::string failure;         // why it did not go the whole way, or nothing
  double worst_angle_deg = 0.0;
  double jacobian_ratio = 0.0;
};

// `rings` are those of one junction, one for each branch; `openings` has the new places of their
// first rows, moved within the planes of the openings and with the old derivatives' ratios at the
// seams. The rows next to the openings slide along the branches' axes, all else is free
// (recovery/fit/patches.h). Stops short, and says why, where the least |Su x Sv| over its mean
// would fall below half of what it was (or .03) or another gate fails; openings then stop where the
// junction does.
MovedPatches move_junction(const SurfaceNetwork& network, const std::vector<StripRing>& rings,
                           const std::map<int, Vec3>& openings,
                           const std::vector<PatchSample>& samples);

// The same for a closed surface of Bezier patches (recovery/fit/closed_surface.h): no openings,
// every point is free.
MovedPatches move_closed(const SurfaceNetwork& network, const std::vector<int>& patches,
                         double radius_mm, const std::vector<PatchSample>& samples);

}  // namespace angiospline
