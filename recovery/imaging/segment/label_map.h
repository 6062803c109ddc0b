// Images that already say what is vessel: masks, label maps and level sets.
#pragma once

#include <string>

#include "base/result.h"
#include "recovery/imaging/image/any_image.h"

namespace angiospline {

// The image as a mask on the same grid: nonzero voxels are inside, so all labels of a label map
// together. Voxels that are NaN or infinite are outside. Errors: no voxel is inside (names `file`).
// O(voxels).
Result<Mask> mask_from_image(const AnyImage& image, const std::string& file);

// The inside of a level set: voxels below 0; NaN is outside. Errors: there are none (names `file`).
// O(voxels).
Result<Mask> mask_from_level_set(const AnyImage& image, const std::string& file);

}  // namespace angiospline
