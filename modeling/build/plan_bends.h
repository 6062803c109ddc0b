// Branches that bend inside their junction: planned last, where openings still strain the bodies.
#pragma once

#include <vector>

#include "modeling/build/plan.h"

namespace angiospline {

// The most ways that are kept for a node.
inline constexpr int kBendAlternatives = 4;

// Where openings still strain the bodies behind them, branches may bend inside their junctions:
// their rays begin on their paths. Sets Plan::bends to the ways to do so, at most
// kBendAlternatives a node, the best first; none where it is not worth it. Requires a settled plan.
// Parallel over nodes.
void find_bends(Plan& plan);

// Takes of each node the first of its ways that is not refused and leaves every branch its room;
// `refused` (one entry a node): so many of its ways are not to be taken. Returns the nodes that
// have changed. The ways belong to the plan as find_bends() left it: to bend again, begin with a
// copy that was made before. Requires that find_bends() was called.
std::vector<int> bend(Plan& plan, const std::vector<int>& refused);

}  // namespace angiospline
