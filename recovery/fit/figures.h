// What a fit did to each part of a model, in figures.
#pragma once

#include <string>
#include <vector>

#include "kernel/geometry/triangle_mesh.h"

namespace angiospline {

// A part of the wall that stayed where it was, or went a part of its way, and why.
struct HeldRegion {
  std::string name;
  std::string why;
};

struct PartFigures {
  std::string name;
  double residual_mean = 0.0, residual_most = 0.0;  // of |residual|, where known
  double moved_mean_mm = 0.0, moved_most_mm = 0.0;  // from the surface before
};

// Of each part of the wall of `mesh`, and last of all together (named "all"). `residual` is a field
// at its points (NaN: not known); `before` the surface it came from. O(n log n).
std::vector<PartFigures> part_figures(const TriangleMesh& mesh, const MeshField& residual,
                                      const TriangleMesh& before);

}  // namespace angiospline
