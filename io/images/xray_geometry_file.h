// X-ray projections from a small JSON file: where source and detector stood, and the image files.
#pragma once

#include <filesystem>
#include <vector>

#include "base/result.h"
#include "recovery/imaging/image/xray.h"

namespace angiospline {

// The views of a file like
//   {"schema": 1, "views": [
//     {"image": "a.tif", "angle_deg": 30, "centre_mm": [0, 0, 0], "source_to_centre_mm": 750,
//      "source_to_detector_mm": 1000, "pixel_mm": 0.8},
//     {"image": "b.tif", "source_mm": [0, 0, -750], "first_pixel_mm": [-100, -100, 250],
//      "column_axis": [1, 0, 0], "row_axis": [0, 1, 0], "pixel_mm": [0.8, 0.8]}]}
// A view is either a C-arm (see recovery/imaging/image/xray.h) or source and detector in full; axes
// are made unit vectors. Image names are relative to the file; the number of pixels is the image's.
// Errors name the file, the view and the field: not JSON, missing or non-numeric fields, distances
// or pixels not positive, axes that are zero or parallel, image errors.
Result<std::vector<XrayView>> read_xray_views(const std::filesystem::path& path);

// Writes such a file, with source and detector in full, and the images NAME_1.mha, NAME_2.mha, ...
// beside it, where NAME is the file's own without its suffix. Reading it gives the same views.
// Error: kCannotWrite.
Result<void> write_xray_views(const std::vector<XrayView>& views,
                              const std::filesystem::path& path);

}  // namespace angiospline
