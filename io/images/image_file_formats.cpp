// Which format a file is, and what every image must be, whatever its format.
#include "io/images/image_file_formats.h"

#include <algorithm>
#include <cctype>
#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "io/images/rules.h"

namespace angiospline::image_formats {
namespace fs = std::filesystem;

namespace {

std::string lower_name(const fs::path& path) {
  std::string name = path.filename().string();
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return name;
}

constexpr ImageSuffix kSuffixes[] = {
    {".nii.gz", Format::kNifti, true, true}, {".nii", Format::kNifti, true, true},
    {".nrrd", Format::kNrrd, true, true},    {".nhdr", Format::kNrrd, true, false},
    {".mha", Format::kMeta, true, true},     {".mhd", Format::kMeta, true, false},
    {".tiff", Format::kTiff, true, true},    {".tif", Format::kTiff, true, true},
    {".png", Format::kPng, true, false},     {".dcm", Format::kDicom, true, false}};

}  // namespace

const ImageSuffix* suffix_of(const fs::path& path) {
  const std::string name = lower_name(path);
  for (const ImageSuffix& s : kSuffixes)
    if (name.ends_with(s.text)) return &s;
  return nullptr;
}

bool is_vti(const fs::path& path) { return lower_name(path).ends_with(".vti"); }

const char* title(Format format) {
  switch (format) {
    case Format::kNifti:
      return "NIfTI";
    case Format::kNrrd:
      return "NRRD";
    case Format::kMeta:
      return "MetaImage";
    case Format::kTiff:
      return "TIFF";
    case Format::kPng:
      return "PNG";
    case Format::kDicom:
      return "DICOM";
  }
  return "";
}

tl::unexpected<Error> bad_image(const fs::path& path, std::string what, std::string value,
                                std::string rule) {
  return fail(
      {ErrorKind::kBadInput, std::move(what), path.string(), std::move(value), std::move(rule)});
}

Result<void> check_axes(const Description& d, const fs::path& path, int wanted) {
  if (d.components != 1)
    return bad_image(path, "voxels are vectors", fmt::format("{} components", d.components),
                     "an image has one value a voxel");
  const std::string shape = fmt::format("{}", fmt::join(d.axes, "x"));
  for (const long long n : d.axes) {
    if (n <= 0)
      return bad_image(path, "image has no voxels", shape, "every extent must be positive");
    if (n > 65535) return bad_image(path, "image is too large", shape, "extents go up to 65535");
  }

  const bool beyond = std::any_of(d.axes.begin() + std::min<std::ptrdiff_t>(3, std::ssize(d.axes)),
                                  d.axes.end(), [](long long n) { return n > 1; });
  if (beyond)
    return bad_image(path, fmt::format("image is {}-D", d.axes.size()), shape,
                     fmt::format("a {}-D image is wanted: extract one frame", wanted));

  const bool flat = d.axes.size() < 3 || d.axes[2] == 1;
  if (wanted == 2 && !flat) return bad_image(path, "image is 3-D", shape, "a 2-D image is wanted");
  if (wanted == 3 &&
      (d.axes.size() < 3 || *std::min_element(d.axes.begin(), d.axes.begin() + 3) == 1))
    return bad_image(path, "image is 2-D", shape, "a 3-D image is wanted: every extent at least 2");
  return {};
}

Result<AnyImage> read_one(const fs::path& path, Format format, int dimensions) {
  return describe(path, format)
      .and_then([&](const Description& d) { return check_axes(d, path, dimensions); })
      .and_then([&] { return read_voxels(path, format); });
}

Result<ImageGrid> checked(ImageGrid grid, const fs::path& path) {
  for (int i = 0; i < 3; ++i)
    if (!(grid.spacing_mm[i] > 0) || !std::isfinite(grid.spacing_mm[i]))
      return bad_image(path, fmt::format("spacing of axis {} is not positive", i),
                       fmt::format("{}", grid.spacing_mm[i]), "spacing must be positive");
  if (!grid.origin_mm.allFinite())
    return bad_image(path, "origin is not finite", {},
                     "the position of the first voxel must be finite");
  const Mat3 gram = grid.direction.transpose() * grid.direction;
  if (!grid.direction.allFinite() || !gram.isIdentity(kDirectionRounding))
    return bad_image(path, "axes of the image are not orthogonal", {},
                     "the direction must be a rotation or reflection: resample the image");

  // The nearest orthogonal matrix (the polar factor) undoes the rounding; an exact identity stays.
  const Eigen::JacobiSVD<Mat3> svd(grid.direction, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Mat3 nearest = svd.matrixU() * svd.matrixV().transpose();
  if (!grid.direction.isIdentity(0)) grid.direction = nearest;
  return grid;
}

}  // namespace angiospline::image_formats
