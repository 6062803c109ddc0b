// Corners of patches at which curves meet: their tangents brought into one plane.
#pragma once

#include "modeling/network/surface_network.h"

namespace angiospline {

// Projects the control points next to a corner, on every side that ends there, onto the corner's
// mean tangent plane: the normals of all patches at the corner become equal, and nothing else
// moves. `corner` is the corner's pool column; returns the farthest move, in mm. For an inner
// corner whose neighbours are no Dependencies; linear in the patches.
double flatten_corner(SurfaceNetwork& network, int corner);

}  // namespace angiospline
