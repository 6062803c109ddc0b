// The value in the middle of some others.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace angiospline {

// The upper of the two in the middle where their count is even; 0 of none. Linear time.
inline double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace angiospline
