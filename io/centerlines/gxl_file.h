// VascuSynth trees (GXL): nodes with positions in voxels, edges with radii in the voxel width's
// unit.
#pragma once

#include <string_view>

#include "base/result.h"
#include "io/reading/reader_options.h"
#include "modeling/tree/centerline_tree.h"

namespace angiospline {

// Positions are multiplied by the voxel width (options.voxel_width, else VascuSynth's own 0.04,
// which the assumptions say); both then are lengths in the file's unit, taken for mm unless it is
// given.
Result<CenterlineTree> parse_gxl(std::string_view text, std::string_view name,
                                 const CenterlineFileOptions& options = {});

}  // namespace angiospline
