#include "io/images/image_file.h"

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>

#include <fmt/format.h>

#include "io/images/image_file_formats.h"
#include "io/images/image_stack.h"

namespace angiospline {
namespace fs = std::filesystem;
using namespace image_formats;

namespace {

Result<void> check_present(const fs::path& path) {
  std::error_code error;
  const auto status = fs::status(path, error);
  if (!fs::exists(status)) return bad_image(path, "there is no such file");
  if (fs::is_regular_file(status) && fs::file_size(path, error) == 0)
    return bad_image(path, "file is empty");
  return {};
}

AnyImage scaled(AnyImage image, const MetaScaling& scaling) {
  return std::visit(
      [&](const auto& in) {
        Image<float> out(in.grid);
        std::transform(in.voxels.begin(), in.voxels.end(), out.voxels.begin(), [&](auto v) {
          return static_cast<float>(scaling.slope * static_cast<double>(v) + scaling.offset);
        });
        return AnyImage(std::move(out));
      },
      image);
}

// One file, after the checks its format needs; `notes` gathers what was assumed.
Result<AnyImage> read_checked(const fs::path& path, Format format, int dimensions,
                              std::vector<std::string>& notes) {
  if (format == Format::kNifti) {
    const auto checked_notes = check_nifti(path);
    if (!checked_notes) return fail(checked_notes.error());
    notes.insert(notes.end(), checked_notes->begin(), checked_notes->end());
    return read_one(path, format, dimensions).map([&](AnyImage image) {
      restore_non_finite(image, path);
      return image;
    });
  }

  // ITK leaves the scaling of a MetaImage to the caller.
  if (format != Format::kMeta) return read_one(path, format, dimensions);
  const Result<MetaScaling> scaling = check_meta(path);
  if (!scaling) return fail(scaling.error());
  return read_one(path, format, dimensions).map([&](AnyImage image) {
    const bool plain = scaling->slope == 1 && scaling->offset == 0;
    return plain ? std::move(image) : scaled(std::move(image), *scaling);
  });
}

template <typename T>
std::size_t non_finite_count(const Image<T>& image) {
  if constexpr (std::is_floating_point_v<T>)
    return static_cast<std::size_t>(std::count_if(image.voxels.begin(), image.voxels.end(),
                                                  [](T x) { return !std::isfinite(x); }));
  return 0;
}

ImageFile with_report(AnyImage image, std::string format, std::vector<std::string> notes) {
  ImageFile file{std::move(image), std::move(format), 0, std::move(notes)};
  file.non_finite = std::visit([](const auto& i) { return non_finite_count(i); }, file.image);
  if (file.non_finite > 0)
    file.notes.push_back(
        fmt::format("{} of {} voxels are NaN or infinite; they count as background",
                    file.non_finite, grid_of(file.image).voxel_count()));
  return file;
}

Error unknown_suffix(const fs::path& path) {
  return {ErrorKind::kBadInput,
          "image format is not known by its suffix",
          path.string(),
          {},
          ".nii .nii.gz .nrrd .nhdr .mha .mhd .vti .tif .tiff .dcm or a folder are read"};
}

}  // namespace

Result<ImageFile> read_image(const fs::path& path, const ReadImageOptions& options,
                             const Progress& progress) {
  if (const auto present = check_present(path); !present) return fail(present.error());
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) {
    return read_image_folder(path, options, progress).map([](ImageStack stack) {
      return with_report(std::move(stack.image), std::move(stack.format), std::move(stack.notes));
    });
  }

  progress.at("read", 0);
  if (is_vti(path))
    return read_vti(path).and_then([&](AnyImage image) -> Result<ImageFile> {
      const Voxel n = grid_of(image).size;
      const Description d{{n[0], n[1], n[2]}, 1, grid_of(image)};
      if (const auto ok = check_axes(d, path, 3); !ok) return fail(ok.error());
      return with_report(std::move(image), "VTI", {"VTI names no world: taken as LPS"});
    });

  const ImageSuffix* s = suffix_of(path);
  if (s == nullptr || !s->reads) return fail(unknown_suffix(path));
  std::vector<std::string> notes;
  return read_checked(path, s->format, 3, notes).map([&](AnyImage image) {
    if (s->format == Format::kTiff) set_stack_geometry(image, options, notes);
    return with_report(std::move(image), title(s->format), std::move(notes));
  });
}

Result<ImageFile> read_flat_image(const fs::path& path, const ReadImageOptions& options) {
  if (const auto present = check_present(path); !present) return fail(present.error());
  const ImageSuffix* s = suffix_of(path);
  if (s == nullptr) return fail(unknown_suffix(path));
  std::vector<std::string> notes;
  return read_checked(path, s->format, 2, notes).map([&](AnyImage image) {
    if (s->format == Format::kTiff || s->format == Format::kPng)
      set_stack_geometry(image, options, notes);
    return with_report(std::move(image), title(s->format), std::move(notes));
  });
}

}  // namespace angiospline
