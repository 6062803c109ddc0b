// Whether a junction's surface may be used: the figures behind the gates.
#pragma once

#include <string>

#include "modeling/junction/unknowns.h"
#include "modeling/layout/target.h"
#include "modeling/layout/topology.h"

namespace angiospline {

struct JunctionQuality {
  double worst_angle_deg = 0.0;  // between normals over all inner edges, 33 samples with corners
  double jacobian_ratio = 0.0;   // least |Su x Sv| over its mean on the same patch
  double normal_off_target_deg = 0.0;  // largest angle to the target's normal
  double off_target = 0.0;             // largest distance from the target, over the smallest radius
  double curvature_times_radius = 0.0;  // largest curvature times the smallest radius
  double target_curvature = 0.0;   // the target's at the same places; 0 where the surface's is good
  double distance_to_union = 0.0;  // from the branches' cylinders, over the smallest radius
  bool self_intersecting = false;
};

// Measures every patch on a grid of 13 x 13 parameters, ends included.
JunctionQuality junction_quality(const JunctionTopology& topology, const JunctionTarget& target,
                                 const JunctionNet& net);

// The same without a target: what concerns it stays zero. A surface that leaves the rays from the
// origin is searched for self-intersections.
JunctionQuality junction_quality(const JunctionTopology& topology, const JunctionNet& net);

// Unit normals on the same grids, patch by patch.
Points3 junction_normals(const JunctionTopology& topology, const JunctionNet& net);

// Limits of what is usable at all, and of what is also a fair surface.
bool is_sound(const JunctionQuality& quality);
bool is_fair(const JunctionQuality& quality);

// Of a fair surface: the larger of curvature and distance from the target, each over what is good;
// of others: the larger of curvature and distance from the cylinders, each over what is fair.
double departure(const JunctionQuality& quality);

// Fair, near its target and not notably sharper: a further try could hardly be better.
bool is_faithful(const JunctionQuality& quality, double most_curvature_times_radius);

// The first gate the surface does not pass, with value and limit; empty when it is sound.
std::string failed_gate(const JunctionQuality& quality);

}  // namespace angiospline
