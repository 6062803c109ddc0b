// A junction moved to where the wall is, its patches still with common tangent planes.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "recovery/fit_rings.h"

namespace angiospline {

// A place of the junction's surface and where it should come to lie.
struct JunctionSample {
  int patch = -1;  // of the network
  Vec2 uv = Vec2::Zero();
  Vec3 target_mm = Vec3::Zero();
  Vec3 normal = Vec3::Zero();  // unit, of the wall there
  double weight = 1.0;
};

struct MovedJunction {
  std::map<int, Vec3> points;  // new places of pool columns
  std::string failure;         // empty: it may be used; otherwise the gate it failed
  double worst_angle_deg = 0.0;
  double jacobian_ratio = 0.0;
};

// `rings` are those of one junction, one for each branch; `openings` has the new places of their
// first rows, moved within the planes of the openings and with the old derivatives' ratios at the
// seams. The rows next to the openings slide along the branches' axes, all else is free: least
// squares on distances to the samples' planes under F' + rho G' = nu H' on all inner edges
// (modeling/tangent_plane_rows.h), by Gauss-Newton steps on the KKT system and a final
// polish. Fails, and says why, if the net is not of this kind, if normals of neighbours differ by
// more than 0.005 degrees, if the least |Su x Sv| over its mean falls below half of what it was (or
// .03), or if a normal turns by more than 60 degrees.
MovedJunction move_junction(const SurfaceNetwork& network, const std::vector<StripRing>& rings,
                            const std::map<int, Vec3>& openings,
                            const std::vector<JunctionSample>& samples);

}  // namespace angiospline
