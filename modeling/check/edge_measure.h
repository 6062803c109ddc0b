// What single edges contribute to a certificate: gaps and angles.
#pragma once

#include <vector>

#include "base/progress.h"
#include "modeling/check/face_measure.h"
#include "modeling/solid/boundary_model.h"

namespace angiospline {

struct EdgeMeasure {
  double gap_mm = 0.0;
  double angle_deg = -1.0;  // between the faces' normals; -1: not a smooth edge
  Vec3 worst_mm = Vec3::Zero();
  int samples = 0;
};

// An edge of two faces; and one whose faces are both walls.
bool is_shared(const BoundaryEdge& edge);
bool is_smooth(const BoundaryModel& model, const BoundaryEdge& edge);

// At `intervals` steps on each span of each shared edge, ends included, with both faces evaluated
// at their own parameters. On all cores; stops early, with what it has, on request.
std::vector<EdgeMeasure> measure_edges(const BoundaryModel& model,
                                       const std::vector<FaceMeasure>& faces, int intervals,
                                       const Progress& progress);

}  // namespace angiospline
