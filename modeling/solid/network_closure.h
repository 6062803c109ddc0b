// What closing a network takes, in numbers: gaps of joins, planes of caps, volumes.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "kernel/spline/surface.h"
#include "modeling/network/network_topology.h"
#include "modeling/network/surface_network.h"

namespace angiospline {

// A network with its topology and the surface of each patch, which outlive this.
struct NetworkShape {
  const SurfaceNetwork& network;
  const NetworkTopology& topology;
  const std::vector<BSplineSurface<3>>& surfaces;
};

// "patch 3 of wall_aorta"
std::string patch_title(const SurfaceNetwork& network, int patch);

// For each edge the largest distance between its two sides, by samples that include the ends; 0 for
// a rim's. O(edges).
std::vector<double> join_gaps_mm(const NetworkShape& shape);

// The first join whose sides are farther apart than a thousandth of its radius, as an error.
std::optional<Error> find_open_join(const NetworkShape& shape, const std::vector<double>& gaps_mm);

struct CapPlane {
  Vec3 center_mm;
  Vec3 normal;         // unit, out of the vessel: the loop runs counter-clockwise around it
  double distance_mm;  // no point of the rim lies farther from the plane
};

// The rim's own plane if its control points lie in it, else the best fitting one. Error: the rim is
// not plane to a thousandth of its size.
Result<CapPlane> cap_plane(const NetworkShape& shape, int rim);

// The volume of each component with its caps (one a rim), by Gauss rules that are exact but for
// rounding: in a component of ten thousand branches the faces that are far from its origin cancel
// to a millionth, and the errors of a coarse rule would turn the sign. Negative: inside out.
std::vector<double> signed_volumes_mm3(const NetworkShape& shape,
                                       const std::vector<CapPlane>& planes);

}  // namespace angiospline
