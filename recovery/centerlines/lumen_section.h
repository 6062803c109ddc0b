// A vessel cut across: where its middle is and how wide it is, at sub-voxel accuracy.
#pragma once

#include <array>

#include "recovery/imaging/image/image.h"

namespace angiospline {

inline constexpr int kSectionRays = 32;

// The plane figure in which a plane cuts the lumen around a point.
struct LumenSection {
  Vec3 center_mm = Vec3::Zero();  // of a circle: its centre, to second order in the point's offset
  double radius_mm = 0.0;         // of the circle of equal area
  bool closed = false;  // false: some ray left the lumen's neighbourhood without meeting a wall
  // From the point to the wall along each ray, evenly about the normal from plane_basis().u to v.
  std::array<double, kSectionRays> wall_mm{};
};

// The section through `point_mm` with the given unit normal, by `kSectionRays` rays. The wall is
// where the mask, interpolated linearly between voxel centres, falls below one half; outside the
// image is background. `longest_mm` is how far a ray may go before the section counts as open. If
// the point itself is background the section is not closed and has radius 0.
LumenSection lumen_section(const Mask& mask, const Vec3& point_mm, const Vec3& normal,
                           double longest_mm);

// The lumen about a section, by counting the voxels of the mask in a slab of half-width `reach_mm`
// about the plane, weighted by a raised cosine across it.
struct CountedSection {
  Vec3 center_mm = Vec3::Zero();  // the centroid, in the plane
  double radius_mm = 0.0;         // of the circle whose area is the volume over the slab's weight
};

// Voxels farther out than the section's wall and one voxel are another vessel's. Unlike a wall
// between voxel centres, a count has no bias in narrow or unevenly sampled vessels, since a mask
// holds on average the volume that it was sampled from; but it scatters more. Requires a closed
// section at `point_mm` with this normal, and a vessel that goes on to both sides. No voxel at all:
// radius 0 at the point.
CountedSection counted_section(const Mask& mask, const LumenSection& section, const Vec3& point_mm,
                               const Vec3& normal, double reach_mm);

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
