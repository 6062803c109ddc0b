// Takes out of a tree what has no length or no wall of its own, and says so; and rounds its numbers
// so that they do not depend on the unit they were written in.
#pragma once

#include <string>
#include <vector>

#include "base/warning.h"
#include "modeling/tree/centerline_tree.h"

namespace angiospline {

struct CleanedTree {
  CenterlineTree tree;
  std::vector<Warning> warnings;  // what was dropped, by name
};

// In this order: branches with a radius that is not positive and finite; points that repeat the one
// before them; branches without length (their nodes
// become one); spurs, that is terminal branches whose tip lies inside the lumen of another branch
// of their node (shortest first, and never below two branches at a node); nodes of degree two,
// whose branches are joined under the name "<from>_<to>"; points that were traced out of order (the
// course turns back twice within six radii, and the other order is shorter). A ring without
// junctions keeps one node. Inlets that vanish are replaced by the widest end of their component.
// Names survive where their node or branch does. O(points log points).
CleanedTree clean_tree(const CenterlineTree& tree);

// The digits that are kept: a file of the same tree in another unit differs by some 2^-52 of the
// extent, which is rounded away but for one number in two million.
inline constexpr int kKeptBits = 30;

// The same tree with coordinates as multiples of a power of two, 2^-kKeptBits of the longest side
// of its box or up to twice that, and radii of kKeptBits binary digits each: a tenth of a nanometre
// in a head. So a tree in metres and one in millimetres become the same numbers, and powers of two
// still scale all of them. Equal numbers stay equal; rounding twice changes nothing. O(points).
CenterlineTree rounded(CenterlineTree tree);

}  // namespace angiospline
