#include "recovery/imaging/segment/label_map.h"

#include <cmath>
#include <cstddef>
#include <variant>

namespace angiospline {
namespace {

template <typename Inside>
Result<Mask> mask_where(const AnyImage& image, const Inside& inside, const Error& none) {
  Mask mask(grid_of(image));
  bool any = false;
  std::visit(
      [&](const auto& typed) {
        for (std::size_t i = 0; i < typed.voxels.size(); ++i) {
          mask.voxels[i] = inside(typed.voxels[i]) ? 1 : 0;
          any = any || mask.voxels[i] != 0;
        }
      },
      image);
  if (!any) return fail(none);
  return mask;
}

}  // namespace

Result<Mask> mask_from_image(const AnyImage& image, const std::string& file) {
  return mask_where(image, [](auto v) { return v != 0 && std::isfinite(static_cast<double>(v)); },
                    {ErrorKind::kBadInput, "mask is empty", file, "all voxels are zero",
                     "a mask has voxels that are not zero inside the vessel"});
}

Result<Mask> mask_from_level_set(const AnyImage& image, const std::string& file) {
  return mask_where(image, [](auto v) { return static_cast<double>(v) < 0; },
                    {ErrorKind::kBadInput, "level set is empty", file, "no voxel is below 0",
                     "a level set is negative inside the vessel"});
}

}  // namespace angiospline
