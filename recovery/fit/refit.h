// Rounds in which walls get more freedom where they miss the image, and are fitted there again.
#pragma once

#include "recovery/fit/fit_model.h"
#include "recovery/wall/wall_profile.h"

namespace angiospline {

// Looks where residuals are larger than noise explains, halves spans there, and fits there again
// with waves half as long as the time before, at most `options.refinements` times. The whole wall
// is looked at once; later rounds measure and solve only around the places that were found, so
// that their cost is that of the neighbourhoods. A region that would fold is left as it was before
// the round; one whose residuals hardly fall is left where it has come to. Walls that cross
// themselves at the end are not kept. `report` counts the rounds' measurements and names the
// regions. Errors: stopped on request; those of meshing.
Result<void> refit_where_large(const GreyField& field, const FitOptions& options,
                               SurfaceNetwork& network, FitReport& report,
                               const Progress& progress);

}  // namespace angiospline
