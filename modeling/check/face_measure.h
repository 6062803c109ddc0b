// What single faces contribute to a certificate.
#pragma once

#include <limits>
#include <vector>

#include "base/progress.h"
#include "modeling/solid/boundary_model.h"

namespace angiospline {

struct FaceMeasure {
  double area_mm2 = 0.0;
  double volume_mm3 = 0.0;  // of the cone from the origin, signed: they add up to the solid's
  Vec3 lowest_mm = Vec3::Constant(std::numeric_limits<double>::infinity());
  Vec3 highest_mm = Vec3::Constant(-std::numeric_limits<double>::infinity());
  double mean_jacobian = 0.0;
  double jacobian_ratio = 1.0;  // least |Su x Sv| over its mean
  double max_curvature = 0.0;   // the larger principal one, in 1 / mm
};

// Whole patches by Gauss's rule on each span, which is exact for the volume of polynomial patches
// of odd degree; planes by their edges; others by Green's theorem in their parameters, with Gauss's
// rule of eight points on each smooth piece. Extremes on a grid with `intervals` steps on each
// span. On all cores; stops early, with what it has, on request.
std::vector<FaceMeasure> measure_faces(const BoundaryModel& model, int intervals,
                                       const Progress& progress);

// The corners of the box around all faces: the patches that reach nearest to a side are searched
// further than their grid.
std::pair<Vec3, Vec3> tight_box(const BoundaryModel& model, const std::vector<FaceMeasure>& faces,
                                int intervals);

}  // namespace angiospline
