// How densely a patch must be sampled for its triangles to lie close to it.
#pragma once

#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "kernel/spline/surface.h"
#include "modeling/network/surface_network.h"
#include "modeling/network/tessellation.h"

namespace angiospline {

// Wanted segments for each unit of a parameter, as a polyline over growing parameters.
struct Density {
  std::vector<double> parameters;
  std::vector<double> values;

  double operator()(double t) const;  // continued as a constant
  double integral() const;            // the number of segments wanted in all
};

// Samples in [0, 1], first 0, last 1, that divide the integral of `density`, given at equal steps,
// evenly: at least `least` segments, and as many as the integral asks for.
std::vector<double> equidistribute(const std::vector<double>& density, int least);

struct PatchSpacing {
  Density u;
  Density v;
};

// What the options ask of a patch of a region with smallest radius `radius_mm`, for each grid line
// the most that any point on it asks.
PatchSpacing spacing_of(const BSplineSurface<3>& surface, double radius_mm,
                        const TessellationOptions& options);

// Along a side: of v for sides u0 and u1.
const Density& density_along(const PatchSpacing& spacing, PatchSide side);

struct NetworkSpacing {
  std::vector<PatchSpacing> patches;
  TessellationOptions used;
};

// What the options ask of every patch, or coarser ones where they ask for more triangles than they
// allow and may be coarsened: all tolerances times a factor, and edges, whose squares they bound,
// by its root, so that the chord tolerance is little above the least of two digits that fits.
// Requires one surface a patch. Errors: too many triangles, naming the tolerance that fits if there
// is one; stopped on request.
Result<NetworkSpacing> spacing_of(const SurfaceNetwork& network,
                                  const std::vector<BSplineSurface<3>>& surfaces,
                                  const TessellationOptions& options, const Progress& progress);

}  // namespace angiospline
