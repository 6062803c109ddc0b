// Self-intersection of sampled patches: an exact-enough brute force with boxes in front.
#pragma once

#include <vector>

#include "base/vector.h"

namespace angiospline {

// Whether any two triangles of these size x size point grids (column i * size + j) cross each
// other. Triangles that share a point, or points closer than a millionth of the extent, are not
// compared, so grids may share edges. Boxes are sorted along the longest axis: O(n log n) plus
// overlaps.
bool grids_cross(const std::vector<Points3>& grids, int size);

}  // namespace angiospline
