// Edges between voxels: where along its direction an edge lies, and with what curvature.
#pragma once

#include <vector>

#include "recovery/thesis/edges/edge_detection.h"

namespace angiospline {

enum class EdgeCorrection {
  // The peak of the edge's own mask along its direction, interpolated cubically between voxels. On
  // a
  // curved wall it lies about 1.2 / R voxels on the side of the centre (R in voxels), as every
  // operator that matches straight steps does; on a plane it has no bias.
  kNone,
  // From there the curved profile sum of wall_profile.h: the offset for which as much bright stuff
  // lies along the normal as the image has. Normal and curvatures are those of the level surface
  // through the point in an image smoothed by one voxel: level surfaces of a blurred sphere or
  // cylinder are spheres and cylinders about the same centre, so blur does not bias them.
  kCurvature,
};

struct EdgePlace {
  Vec3 point_mm = Vec3::Zero();
  Vec3 normal = Vec3::Zero();  // unit, world; from bright to dark: out of a bright vessel
  double strength = 0.0;
  double largest_curvature = 0.0;  // 1 / mm, positive where the bright side is convex; 0 with kNone
  double smallest_curvature = 0.0;
  bool corrected = false;  // false: kNone, or no profile could be summed (border, no contrast)
};

// A place for each edge of `field`, in its order. Requires a volume at least two voxels thick and
// edges found in `image`. An edge that a correction would move by more than two voxels stays where
// its peak is, with corrected false. About 30 microseconds an edge a core; on all cores, the same
// result on any number of threads.
std::vector<EdgePlace> localise_edges(const Image<float>& image, const EdgeField& field,
                                      EdgeCorrection correction = EdgeCorrection::kCurvature);

}  // namespace angiospline
