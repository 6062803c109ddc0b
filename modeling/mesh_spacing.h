// How densely a patch must be sampled for its triangles to lie close to it.
#pragma once

#include <vector>

#include "kernel/surface.h"
#include "modeling/tessellation.h"

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

}  // namespace angiospline
