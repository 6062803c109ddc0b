#include "recovery/thesis/experiments/outline.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/contract.h"
#include "base/index.h"

namespace angiospline {

Mask mask_inside(const Points3& outline_mm, const ImageGrid& grid) {
  EXPECTS(grid.size[2] == 1);

  // A side meets the rows between its ends; a row through an end counts it for one side only.
  std::vector<std::vector<double>> crossings(index(grid.size[1]));
  const Eigen::Index n = outline_mm.cols();
  for (Eigen::Index k = 0; k < n; ++k) {
    const Vec3 a = grid.index_vox(Vec3(outline_mm.col(k)));
    const Vec3 b = grid.index_vox(Vec3(outline_mm.col((k + 1) % n)));
    const int first = std::max(0, static_cast<int>(std::ceil(std::min(a[1], b[1]))));
    const int last = std::min(grid.size[1] - 1, static_cast<int>(std::floor(std::max(a[1], b[1]))));
    for (int y = first; y <= last; ++y)
      if ((a[1] > y) != (b[1] > y))
        crossings[index(y)].push_back(a[0] + (y - a[1]) * (b[0] - a[0]) / (b[1] - a[1]));
  }

  // Between the first and second crossing of a row is inside, between the second and third not.
  Mask mask(grid);
  for (int y = 0; y < grid.size[1]; ++y) {
    std::vector<double>& at = crossings[index(y)];
    std::sort(at.begin(), at.end());
    for (std::size_t k = 0; k + 1 < at.size(); k += 2) {
      const int first = std::max(0, static_cast<int>(std::ceil(at[k])));
      const int last = std::min(grid.size[0] - 1, static_cast<int>(std::floor(at[k + 1])));
      for (int x = first; x <= last; ++x) mask[{x, y, 0}] = 1;
    }
  }
  return mask;
}

}  // namespace angiospline
