// A patch and its derivatives on a whole grid of parameters at once.
#pragma once

#include <array>
#include <vector>

#include "base/vector.h"
#include "kernel/surface.h"

namespace angiospline {

// Derivative (a, b) at (us[i], vs[j]) is column i * vs.size() + j of at(a, b); a + b <= order.
struct PatchGrid {
  int order = 0;
  std::array<Points3, 6> values;  // S, Su, Sv, Suu, Suv, Svv: the first (order + 1)(order + 2) / 2

  const Points3& at(int a, int b) const {
    const int n = a + b;
    return values[static_cast<std::size_t>(n * (n + 1) / 2 + b)];
  }
};

// Requires order 0, 1 or 2. Each grid line is contracted once: O(grid * order of the basis).
PatchGrid evaluate_grid(const BSplineSurface<3>& surface, const std::vector<double>& us,
                        const std::vector<double>& vs, int order);

}  // namespace angiospline
