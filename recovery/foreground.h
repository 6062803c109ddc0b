// The voxels of a mask that are not background, found fast.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "recovery/image.h"

namespace angiospline {

// The first i in [from, count) with values[i] != 0, or count. Background is passed eight voxels at
// a time.
inline std::size_t next_foreground(const std::uint8_t* values, std::size_t from,
                                   std::size_t count) {
  while (from + 8 <= count) {
    std::uint64_t word = 0;
    std::memcpy(&word, values + from, sizeof word);
    if (word != 0) break;
    from += 8;
  }
  while (from < count && values[from] == 0) ++from;
  return from;
}

// Offsets of all foreground voxels, in growing order. One pass over the image.
std::vector<std::size_t> foreground_offsets(const Mask& mask);

}  // namespace angiospline
