#include "recovery/imaging/mask/foreground.h"

namespace angiospline {
namespace {

// One past the last value that is not 0; requires that there is one.
std::size_t end_of_foreground(const std::uint8_t* values, std::size_t count) {
  for (std::uint64_t word = 0; count >= 8; count -= 8) {
    std::memcpy(&word, values + count - 8, sizeof word);
    if (word != 0) break;
  }
  while (values[count - 1] == 0) --count;
  return count;
}

}  // namespace

std::vector<RowExtent> row_extents(const Mask& mask) {
  const auto width = static_cast<std::size_t>(mask.grid.size[0]);
  std::vector<RowExtent> rows(width == 0 ? 0 : mask.voxels.size() / width);
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const std::uint8_t* values = mask.voxels.data() + r * width;
    const std::size_t begin = next_foreground(values, 0, width);
    if (begin < width)
      rows[r] = {static_cast<int>(begin), static_cast<int>(end_of_foreground(values, width))};
  }
  return rows;
}

std::vector<std::size_t> foreground_offsets(const Mask& mask) {
  std::vector<std::size_t> offsets;
  const std::size_t count = mask.voxels.size();
  for (std::size_t i = 0; (i = next_foreground(mask.voxels.data(), i, count)) < count; ++i)
    offsets.push_back(i);
  return offsets;
}

}  // namespace angiospline
