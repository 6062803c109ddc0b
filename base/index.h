// Positions in our containers are int or Eigen::Index; the standard library counts in std::size_t.
#pragma once

#include <cstddef>

namespace angiospline {

// `i` as a position in a standard container. Requires i >= 0.
constexpr std::size_t index(std::ptrdiff_t i) { return static_cast<std::size_t>(i); }

}  // namespace angiospline
