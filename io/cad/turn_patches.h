// Patches with their parameters exchanged, for programs that integrate along u less finely than
// along v.
#pragma once

#include "modeling/network/surface_network.h"

namespace angiospline {

// The same network with every patch that has more spans along u than along v turned by a quarter:
// (u, v) becomes (v, first + last - u), so the surface, its outward normal and the pool stay, and
// sides, joins and rims follow. OpenCASCADE's default quadrature of volumes takes one Gauss rule
// for all spans along u and one for each edge along v: a carotid with a body of 64 spans, 980 mm3,
// reads 1082 mm3 in FreeCAD before the turn and 980.32 after it (STEP). O(size).
SurfaceNetwork turn_long_patches(SurfaceNetwork network);

}  // namespace angiospline
