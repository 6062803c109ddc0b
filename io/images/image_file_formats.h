// What the files of this room share: formats, checks, and the calls into the format libraries.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "recovery/imaging/image/any_image.h"

namespace angiospline::image_formats {

enum class Format { kNifti, kNrrd, kMeta, kTiff, kPng, kDicom };

const char* title(Format format);  // as people write it: "NIfTI"

struct ImageSuffix {
  const char* text;
  Format format;
  bool reads;
  bool writes;
};

// What the file's name ends with, whatever its case; null for a suffix that is not known, such as
// VTI's, which has readers of its own.
const ImageSuffix* suffix_of(const std::filesystem::path& path);
bool is_vti(const std::filesystem::path& path);

tl::unexpected<Error> bad_image(const std::filesystem::path& path, std::string what,
                                std::string value = {}, std::string rule = {});

// What a file says of itself, before its voxels are read. Axes of extent 1 beyond the second are
// kept; `axes` lists every extent the file declares.
struct Description {
  std::vector<long long> axes;
  unsigned components = 1;
  ImageGrid grid;  // size[2] is 1 for a 2-D image
};

Result<Description> describe(const std::filesystem::path& path, Format format);

// The voxels of a file with one component a voxel and at most three axes longer than 1.
Result<AnyImage> read_voxels(const std::filesystem::path& path, Format format);

// Whether an image has one value a voxel and `wanted` dimensions, 2 or 3. 3-D means exactly three
// axes longer than 1, the first three; a trailing time axis of one is fine. Extents go up to 65535.
Result<void> check_axes(const Description& d, const std::filesystem::path& path, int wanted);

// The voxels of a file that has `dimensions`.
Result<AnyImage> read_one(const std::filesystem::path& path, Format format, int dimensions);

// What ITK passes over in silence. A NIfTI file: cut short, spacing 0 or not a number, negative
// extents are errors; scaling that is not finite and missing orientation are notes.
Result<std::vector<std::string>> check_nifti(const std::filesystem::path& path);

// The NIfTI library turns voxels that are not finite into 0, which in many images is a bright
// value: puts them back. Reads the voxels of float files once more, and nothing of others.
void restore_non_finite(AnyImage& image, const std::filesystem::path& path);

// A MetaImage: the same errors; its intensity scaling, which ITK leaves to the caller.
struct MetaScaling {
  double slope = 1, offset = 0;
};
Result<MetaScaling> check_meta(const std::filesystem::path& path);

// Files of each DICOM series in a folder, in order of the series' names.
struct DicomSeries {
  std::string uid;
  std::vector<std::string> files;
};
Result<std::vector<DicomSeries>> dicom_series(const std::filesystem::path& folder);

template <typename T>
Result<void> write(const Image<T>& image, const std::filesystem::path& path, Format format);

Result<AnyImage> read_vti(const std::filesystem::path& path);
template <typename T>
Result<void> write_vti(const Image<T>& image, const std::filesystem::path& path);

// The rules every grid obeys: extents and spacing positive and finite, axes orthogonal. Returns the
// grid with its axes made exactly orthonormal (files round them).
Result<ImageGrid> checked(ImageGrid grid, const std::filesystem::path& path);

}  // namespace angiospline::image_formats
