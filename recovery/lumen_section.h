// A vessel cut across: where its middle is and how wide it is, at sub-voxel accuracy.
#pragma once

#include "recovery/image.h"

namespace angiospline {

// The plane figure in which a plane cuts the lumen around a point.
struct LumenSection {
  Vec3 center_mm = Vec3::Zero();  // of a circle: its centre, to second order in the point's offset
  double radius_mm = 0.0;         // of the circle of equal area
  bool closed = false;  // false: some ray left the lumen's neighbourhood without meeting a wall
};

// The section through `point_mm` with the given unit normal, by `kSectionRays` rays. The wall is
// where the mask, interpolated linearly between voxel centres, falls below one half; outside the
// image is background. `longest_mm` is how far a ray may go before the section counts as open. If
// the point itself is background the section is not closed and has radius 0.
inline constexpr int kSectionRays = 32;
LumenSection lumen_section(const Mask& mask, const Vec3& point_mm, const Vec3& normal,
                           double longest_mm);

// How far the lumen goes on from `point_mm` in a unit direction, at most `longest_mm`; 0 in the
// background.
double distance_to_wall_mm(const Mask& mask, const Vec3& point_mm, const Vec3& direction,
                           double longest_mm);

// Two unit vectors that make a right-handed orthonormal basis with the unit vector w.
struct PlaneBasis {
  Vec3 u, v;
};
PlaneBasis plane_basis(const Vec3& w);

}  // namespace angiospline
