// Rounds the numbers of a tree so that its model does not depend on the unit they were written in.
#pragma once

#include "modeling/tree/centerline_tree.h"

namespace angiospline {

// The digits that are kept: a file of the same tree in another unit differs by some 2^-52 of the
// extent, which is rounded away but for one number in two million.
inline constexpr int kKeptBits = 30;

// The same tree with coordinates as multiples of a power of two, 2^-kKeptBits of the longest side
// of its box or up to twice that, and radii of kKeptBits binary digits each: a tenth of a nanometre
// in a head. So a tree in metres and one in millimetres become the same numbers, and powers of two
// still scale all of them. Equal numbers stay equal; rounding twice changes nothing. O(points).
CenterlineTree rounded(CenterlineTree tree);

}  // namespace angiospline
