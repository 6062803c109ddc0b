// More networks made by hand: those that try solids and certificates.
#pragma once

#include "modeling/network/surface_network.h"

namespace angiospline::crafted {

// A tube of two bi-quintic halves about the z axis, with rims "inlet" at z = 0 and "outlet_2".
// Sections are the quintic circle (within 1.8e-6 radii); the axis is sheared along a parabola in x
// by `bend_mm` at mid length, which changes no section's area.
SurfaceNetwork sheared_tube(double radius_mm, double length_mm, double bend_mm = 0.0);

// A tube whose lower half is two patches and whose upper half four: the upper side of each lower
// patch meets two patches, so there is a T-vertex in the middle of it.
SurfaceNetwork tube_of_quarters(double radius_mm, double length_mm);

// One patch that closes on itself: a tube with a seam.
SurfaceNetwork one_patch_tube(double radius_mm, double length_mm);

// A tube, regions "wall_1" and "wall_2", whose upper half widens like a cone: a crease of that many
// degrees all round the middle.
SurfaceNetwork creased_tube(double radius_mm, double length_mm, double crease_deg);

// Area of the disc bounded by the quintic circle of radius 1, by its exact boundary integral.
double unit_disc_area();

}  // namespace angiospline::crafted
