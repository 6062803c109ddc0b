// Whether a surface meets itself where it should not.
#pragma once

#include <array>
#include <string>

#include "base/progress.h"
#include "base/result.h"
#include "modeling/boundary_model.h"

namespace angiospline {

struct SelfIntersection {
  bool found = false;
  std::array<std::string, 2> faces;  // the faces that meet; the same twice for a face with itself
  Vec3 place_mm = Vec3::Zero();
  double resolution_mm = 0.0;  // largest distance between the triangles and the surface
};

// Searches a mesh of the surface, whose faces share the points of their edges, for triangles that
// cross although they share no edge. What is found on a coarse mesh counts only if it stays when
// the two faces are meshed four times as fine, so that chords across tight places raise no alarm.
// On a surface with free edges only
// crossings of a face with itself count: loose neighbours touch all along their edges.
// O(n log n) in the triangles. Errors: stopped on request.
Result<SelfIntersection> find_self_intersection(const BoundaryModel& model, int most_triangles,
                                                const Progress& progress = {});

}  // namespace angiospline
