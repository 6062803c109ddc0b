// Whether a surface meets itself where it should not.
#pragma once

#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "modeling/check/certificate.h"
#include "modeling/solid/boundary_model.h"

namespace angiospline {

struct SelfIntersections {
  std::vector<FaceCrossing> crossings;  // one for each pair of names, in order of the faces
  double resolution_mm = 0.0;           // largest distance between the triangles and the surface
};

// Searches a mesh of the surface, whose faces share the points of their edges, for triangles that
// cross although they share no edge. What is found on a coarse mesh counts only if it stays when
// the two faces are meshed four times as fine, so that chords across tight places raise no alarm.
// On a surface with free edges only
// crossings of a face with itself count: loose neighbours touch all along their edges.
// O(n log n) in the triangles. Errors: stopped on request.
Result<SelfIntersections> find_self_intersections(const BoundaryModel& model, int most_triangles,
                                                  const Progress& progress = {});

}  // namespace angiospline
