// The voxels of a mask that are not background, found fast.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "recovery/imaging/image/image.h"

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

// Where the foreground of a row along x lies: its first column, and the one after its last; both 0
// if it has none.
struct RowExtent {
  int begin = 0, end = 0;
  bool empty() const { return end == 0; }
};

// Of every row, y fastest. One pass over the image; what follows the foreground can then pass over
// the rest of it.
std::vector<RowExtent> row_extents(const Mask& mask);

// Offsets of all foreground voxels, in growing order. One pass over the image.
std::vector<std::size_t> foreground_offsets(const Mask& mask);

}  // namespace angiospline
