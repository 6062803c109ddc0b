// A solid from any source as a boundary model to measure.
#pragma once

#include "base/progress.h"
#include "base/result.h"
#include "modeling/solid/boundary_model.h"

namespace angiospline {

// Untrimmed polynomial B-spline faces become whole patches, plane faces between polynomial edges
// planes; what else there is keeps OpenCASCADE's evaluators and gets areas, volumes, boxes and
// triangles from it. BRepCheck's verdict is in `is_sound`. Linear in the faces.
// Errors: stopped on request; OpenCASCADE failed.
Result<BoundaryModel> boundary_of(const Solid& solid, const Progress& progress = {});

}  // namespace angiospline
