// Folders as images: slices one above the other.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "io/images/image_file.h"

namespace angiospline::image_formats {

struct ImageStack {
  AnyImage image;
  std::string format;              // "DICOM series", "PNG stack"
  std::vector<std::string> notes;  // what was assumed
};

// One DICOM series, or slices .png or .tif in natural order (2 before 10). Errors name the folder
// or the slice: both kinds of pictures; a single picture; several series and none chosen; slices of
// another type or size, turned against the others, at one place, at uneven distances, or sheared by
// a tilted gantry.
Result<ImageStack> read_image_folder(const std::filesystem::path& folder,
                                     const ReadImageOptions& options, const Progress& progress);

// Formats of photographs carry no millimetres: the spacing of the options, else 1 mm, which `notes`
// then say; the axes are the world's.
void set_stack_geometry(AnyImage& image, const ReadImageOptions& options,
                        std::vector<std::string>& notes);

}  // namespace angiospline::image_formats
