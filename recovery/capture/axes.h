// Smooth axes through measured sections: the data choose how smooth.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "modeling/tree/centerline_tree.h"

namespace angiospline {

// Sections along one branch, from its start to its end.
struct AxisSections {
  Points3 centers_mm;
  Eigen::VectorXd along_mm;    // growing
  std::vector<char> measured;  // the others say nothing
  double radius_mm = 1.0;      // typical
};

// The centres on smooth axes: quintic splines whose third derivative, the change of curvature, is
// penalised, so that arcs are free. The strength is chosen by restricted likelihood
// (kernel/fit/penalised_spline.h), each branch's own drawn to the one of all together. Branches of
// fewer than eight measured sections stay as they are. O(sections).
std::vector<Points3> smooth_axes(const std::vector<AxisSections>& branches);

}  // namespace angiospline
