// From a centerline tree to a model: junctions, bodies, rims; what fails is named, the rest is
// kept.
#pragma once

#include "base/progress.h"
#include "base/result.h"
#include "modeling/junction.h"
#include "modeling/model.h"
#include "modeling/smooth_centerlines.h"

namespace angiospline {

struct SeedOptions {
  SmoothingOptions smoothing;
  JunctionOptions junction;
  double body_tolerance = 0.01;  // of a body against its smoothed centerline and radius, in radii
};

// The surface network of a whole tree. Rims are named "inlet" ("inlet_<node>" when there are
// several) and "outlet_<node>", regions "wall_<branch>" and "junction_<node>". A branch or junction
// that cannot be built is listed in Model::failed and the network closes around it. Errors: nothing
// at all could be built; stopped on request.
Result<Model> seed_model(const CenterlineTree& tree, const SeedOptions& options = {},
                         const Progress& progress = {});

// The same from a tree that is smooth already.
Result<Model> seed_smoothed(const SmoothedTree& tree, const SeedOptions& options = {},
                            const Progress& progress = {});

}  // namespace angiospline
