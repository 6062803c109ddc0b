// Patches in an order in which neighbours lie near each other, for programs that look them up in
// lists.
#pragma once

#include "modeling/network/surface_network.h"

namespace angiospline {

// The same network with its regions' patches one region after the other along the vessels: depth
// first, at each fork the branch with the fewest patches beyond it first, so that the way from any
// patch to its neighbours jumps over small branches only (n log n in all for n patches of a tree).
// Rims follow the order of their patches; components stay in theirs. OpenCASCADE's reader of IGES
// finds edges by walking a linked list from the last one found: with all junctions before all
// bodies that is quadratic. O(size log size).
SurfaceNetwork order_by_neighbours(SurfaceNetwork network);

}  // namespace angiospline
