// A random bifurcating tree with room around every branch. Not installed.
#pragma once

#include "base/result.h"
#include "modeling/tree/centerline_tree.h"
#include "recovery/phantoms/phantom.h"

namespace angiospline {

// A tree in the cube [0, field]^3 of the grid's own frame: a root at the bottom, then bifurcations
// by Murray's law (r^3 = r1^3 + r2^3) until `ends` leaves are there. No two branches that do not
// share a node come nearer than a gap of 3 mm plus their radii.
Result<CenterlineTree> random_tree(const PhantomOptions& options);

}  // namespace angiospline
