// Volume images in and out of files. World is LPS millimetres on both sides; the pixel type of the
// file is kept.
//
//   suffix                read  write  notes
//   .nii .nii.gz          yes   yes    RAS of the file becomes LPS; slope and intercept applied
//   .nrrd .nhdr           yes   .nrrd  written with gzip; a `space` other than LPS is converted
//   .mha .mhd             yes   .mha   written with zlib
//   .vti                  yes   yes    taken as LPS: the format names no world
//   .tif .tiff            yes   yes    pages are slices; spacing 1 mm unless stated, noted
//   .dcm                  yes   no     one multi-frame file
//   a folder              yes   no     one DICOM series, or slices .png .tif .tiff in natural order
//
// An intensity slope other than 1 makes the image float (or double), as the values then are.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "recovery/imaging/image/any_image.h"

namespace angiospline {

struct ReadImageOptions {
  // Replaces the spacing of formats that carry none (stacks of PNG or TIFF); ignored by the others.
  std::optional<Vec3> stack_spacing_mm;
  // The series to take where a DICOM folder holds several (its SeriesInstanceUID).
  std::string series_uid;
};

struct ImageFile {
  AnyImage image;
  std::string format;              // "NIfTI", "DICOM series", ...
  std::size_t non_finite = 0;      // voxels that are NaN or infinite; they are kept as they are
  std::vector<std::string> notes;  // what was assumed, and reservations such as non-finite voxels
};

// The 3-D image of a file or folder. Error: missing, empty, truncated or foreign file; 2-D, 4-D or
// vector pixels; spacing not positive; axes not orthogonal; a DICOM folder with several series,
// slices of different size, or a missing slice. An axis of extent 1 makes an image 2-D.
// Memory: the voxels once.
Result<ImageFile> read_image(const std::filesystem::path& path,
                             const ReadImageOptions& options = {}, const Progress& progress = {});

// The 2-D image of a file (an X-ray projection): size[2] is 1. Error: as read_image; a 3-D image.
Result<ImageFile> read_flat_image(const std::filesystem::path& path,
                                  const ReadImageOptions& options = {});

// Writes voxels and geometry; the file appears whole or not at all. Error kCannotWrite: a suffix
// that is not written (the error lists those that are), a folder that is not writable, no space.
// Defined for the pixel types of AnyImage.
template <typename T>
Result<void> write_image(const Image<T>& image, const std::filesystem::path& path);
Result<void> write_image(const AnyImage& image, const std::filesystem::path& path);

}  // namespace angiospline
