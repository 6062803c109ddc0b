#include "modeling/tree/path_knots.h"

#include <cmath>
#include <vector>

#include "kernel/refine/refinement.h"

namespace angiospline {

BSplineCurve<4> with_knots_each_radius(const BSplineCurve<4>& path) {
  const double step = path.control_points().row(3).mean();
  std::vector<double> added;
  const std::vector<double> breaks = path.knots().breakpoints();
  for (std::size_t k = 0; k + 1 < breaks.size(); ++k) {
    const int pieces = static_cast<int>(std::ceil((breaks[k + 1] - breaks[k]) / step));
    for (int i = 1; i < pieces; ++i) {
      added.push_back(breaks[k] + (breaks[k + 1] - breaks[k]) * i / pieces);
    }
  }
  return added.empty() ? path : insert_knots(path, added).value();
}

}  // namespace angiospline
