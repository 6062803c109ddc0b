// Joins cut into pieces that are short against the vessel, for programs that put a fixed number of
// elements on every edge.
#pragma once

#include "modeling/network/surface_network.h"

namespace angiospline {

struct SplitOptions {
  double widths = 1.5;  // a piece is no longer than so many widths of the narrower patch beside it
  double turn_deg = 95.0;  // nor does its tangent turn by more: half circles become quarters
};

// The same patches with every join and every side of a rim cut into as many pieces as `options`
// ask for, of equal measure. No shape changes: pieces are parts of the same sides, and neighbours
// share their ends to the bit. Pieces of a join follow it in its order. O(size).
SurfaceNetwork split_joins(SurfaceNetwork network, const SplitOptions& options = {});

}  // namespace angiospline
