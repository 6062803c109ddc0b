#include "recovery/foreground.h"

namespace angiospline {

std::vector<std::size_t> foreground_offsets(const Mask& mask) {
  std::vector<std::size_t> offsets;
  const std::size_t count = mask.voxels.size();
  for (std::size_t i = 0; (i = next_foreground(mask.voxels.data(), i, count)) < count; ++i)
    offsets.push_back(i);
  return offsets;
}

}  // namespace angiospline
