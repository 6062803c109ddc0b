// A solid from any source as a triangle mesh with named parts.
#pragma once

#include "base/progress.h"
#include "base/result.h"
#include "kernel/geometry/triangle_mesh.h"
#include "modeling/solid/solid.h"

namespace angiospline {

struct SolidTessellationOptions {
  double turn_rad = 0.15;  // a curve turns by at most about this from chord to chord
};

// Triangles that share the points of the solid's edges, wound outward. Faces of one name and kind
// are one part, in the order in which they first appear; walls named "junction..." are junctions.
// Normals are the means of the wall's triangles around each point, weighted by area. Faces that are
// not whole B-spline patches keep OpenCASCADE's own mesh. Errors: no faces; stopped on request;
// OpenCASCADE failed.
Result<TriangleMesh> tessellate(const Solid& solid, const SolidTessellationOptions& options = {},
                                const Progress& progress = {});

}  // namespace angiospline
