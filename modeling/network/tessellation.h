// A surface network as one closed triangle mesh.
#pragma once

#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "kernel/geometry/triangle_mesh.h"
#include "modeling/network/surface_network.h"

namespace angiospline {

// Lengths are in local radii: the smallest vessel radius of the region, or the surface's radius of
// curvature where that is larger, so that one figure serves trunk and twig and a taper between
// them.
struct TessellationOptions {
  double chord_tolerance = 0.01;    // goal for the distance between triangles and surface
  double chord_tolerance_mm = 1e9;  // the same in mm; the smaller one counts
  double longest_edge = 0.75;       // of the wall's triangles: no slivers along straight vessels
  double most_triangles = 2e7;      // some 3 GB; a whole brain at the defaults needs 1e6
  // Where the tolerance asks for more triangles: coarser by as little as is needed, not an error.
  bool coarsen = false;
};

// Where on the network a point of the mesh lies; inside a cap the patch is -1.
struct PatchPoint {
  int patch = -1;
  Vec2 uv = Vec2::Zero();
};

struct Tessellation {
  TriangleMesh mesh;                // parts: the regions, then the rims, in order
  std::vector<PatchPoint> origins;  // one for each point; one of several on a shared edge
  TessellationOptions used;         // those asked for, or the coarser ones that were needed
};

// A mesh whose patches share the points of their joins and whose rims are closed by plane caps: it
// is closed, oriented outward and has the network's topology by construction, whatever the
// geometry. All points but those inside caps lie on the surface. Edges are divided by the larger
// demand of their two sides; the spacing comes from Filip, Magedson, Markot (1986): error <= (hu^2
// |n.Suu| + 2 hu hv |n.Suv| + hv^2 |n.Svv|) / 8, with the second derivatives sampled, not bounded.
// Caps must be star-shaped about the mean of their rim. Requires positive options.
// Errors: the first defect of the network; too many triangles for options that may not be
// coarsened, naming the least tolerance that fits; stopped on request. O(triangles).
Result<Tessellation> tessellate(const SurfaceNetwork& network,
                                const TessellationOptions& options = {},
                                const Progress& progress = {});

}  // namespace angiospline
