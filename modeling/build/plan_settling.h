// A plan is measured and changed until every branch has room.
#pragma once

#include "modeling/build/plan.h"

namespace angiospline {

// Measures the dirty junctions, and does what their branches then need: branches that run inside
// others are dropped, short ones taken straight, their junctions merged, free ends moved out. Again
// until nothing is dirty, at most 64 times. Parallel over junctions. Plan::warnings say what was
// done.
void settle(Plan& plan);

}  // namespace angiospline
