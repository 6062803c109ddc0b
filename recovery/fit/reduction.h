// Fitted bodies with as few knots as their shape needs.
#pragma once

#include "recovery/fit/rings.h"

namespace angiospline {

// Bodies over the length of their axes, cut across it and fitted anew with the fewest equal spans
// that leave every place of them within the tolerance along the normal; one that would take as many
// as it has stays as it is. End rows stay; tangent planes there contain the axis if they did, and
// the relations between neighbouring patches hold in every row: tangent planes stay common. Pool
// columns are numbered anew. Requires a positive tolerance.
SurfaceNetwork with_fewer_knots(const SurfaceNetwork& network, double tolerance_mm);

}  // namespace angiospline
