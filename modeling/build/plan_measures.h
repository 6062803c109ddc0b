// Where the openings of one junction of a plan lie.
#pragma once

#include "modeling/build/plan.h"

namespace angiospline {

// The junction with its specification (directions, radii) and, for each opening, the distances
// wanted and least, where its path is met and where its ray begins; with `error`, and these as far
// as they were found, if no openings exist. What the node asks for (caps, distances farther out,
// rays that begin on their paths) is kept to. Requires a junction of the plan or a changed copy of
// it. O(branches^2) for each of at most sixteen rounds.
PlannedNode measured(const Plan& plan, PlannedNode node);

}  // namespace angiospline
