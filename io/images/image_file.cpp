#include "io/images/image_file.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <numeric>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/atomic_file.h"
#include "io/images/image_file_formats.h"

namespace angiospline {
namespace fs = std::filesystem;
using namespace image_formats;

namespace {

std::string lower_name(const fs::path& path) {
  std::string name = path.filename().string();
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return name;
}

struct Suffix {
  const char* text;
  Format format;
  bool reads;
  bool writes;
};

constexpr Suffix kSuffixes[] = {
    {".nii.gz", Format::kNifti, true, true}, {".nii", Format::kNifti, true, true},
    {".nrrd", Format::kNrrd, true, true},    {".nhdr", Format::kNrrd, true, false},
    {".mha", Format::kMeta, true, true},     {".mhd", Format::kMeta, true, false},
    {".tiff", Format::kTiff, true, true},    {".tif", Format::kTiff, true, true},
    {".png", Format::kPng, true, false},     {".dcm", Format::kDicom, true, false}};

const Suffix* suffix_of(const fs::path& path) {
  const std::string name = lower_name(path);
  for (const Suffix& s : kSuffixes)
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

tl::unexpected<Error> bad(const fs::path& path, std::string what, std::string value = {},
                          std::string rule = {}) {
  return fail(
      {ErrorKind::kBadInput, std::move(what), path.string(), std::move(value), std::move(rule)});
}

Result<void> check_present(const fs::path& path) {
  std::error_code error;
  const auto status = fs::status(path, error);
  if (!fs::exists(status)) return bad(path, "there is no such file");
  if (fs::is_regular_file(status) && fs::file_size(path, error) == 0)
    return bad(path, "file is empty");
  return {};
}

// 3-D means exactly three axes longer than 1, the first three; a trailing time axis of one is fine.
Result<void> check_axes(const Description& d, const fs::path& path, int wanted) {
  if (d.components != 1)
    return bad(path, "voxels are vectors", fmt::format("{} components", d.components),
               "an image has one value a voxel");
  const std::string shape = fmt::format("{}", fmt::join(d.axes, "x"));
  for (const long long n : d.axes) {
    if (n <= 0) return bad(path, "image has no voxels", shape, "every extent must be positive");
    if (n > 65535) return bad(path, "image is too large", shape, "extents go up to 65535");
  }
  const bool beyond = std::any_of(d.axes.begin() + std::min<std::ptrdiff_t>(3, std::ssize(d.axes)),
                                  d.axes.end(), [](long long n) { return n > 1; });
  if (beyond)
    return bad(path, fmt::format("image is {}-D", d.axes.size()), shape,
               fmt::format("a {}-D image is wanted: extract one frame", wanted));
  const bool flat = d.axes.size() < 3 || d.axes[2] == 1;
  if (wanted == 2 && !flat) return bad(path, "image is 3-D", shape, "a 2-D image is wanted");
  if (wanted == 3 &&
      (d.axes.size() < 3 || *std::min_element(d.axes.begin(), d.axes.begin() + 3) == 1))
    return bad(path, "image is 2-D", shape, "a 3-D image is wanted: every extent at least 2");
  return {};
}

Result<AnyImage> read_one(const fs::path& path, Format format, int dimensions) {
  return describe(path, format)
      .and_then([&](const Description& d) { return check_axes(d, path, dimensions); })
      .and_then([&] { return read_voxels(path, format); });
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

ImageGrid& mutable_grid(AnyImage& image) {
  return std::visit([](auto& i) -> ImageGrid& { return i.grid; }, image);
}

// Formats of photographs carry no millimetres.
void set_stack_geometry(AnyImage& image, const ReadImageOptions& options,
                        std::vector<std::string>& notes) {
  ImageGrid& grid = mutable_grid(image);
  grid.spacing_mm = options.stack_spacing_mm.value_or(Vec3::Ones());
  grid.origin_mm.setZero();
  grid.direction.setIdentity();
  if (!options.stack_spacing_mm)
    notes.push_back("the stack carries no spacing: 1 x 1 x 1 mm is assumed");
}

// ---- stacks of slices -------------------------------------------------------------------------

// Slice 2 before slice 10: runs of digits compare as numbers.
bool natural_less(const std::string& a, const std::string& b) {
  std::size_t i = 0, j = 0;
  const auto digit = [](char c) { return c >= '0' && c <= '9'; };
  while (i < a.size() && j < b.size()) {
    if (!digit(a[i]) || !digit(b[j])) {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i, ++j;
      continue;
    }
    std::size_t i_end = i, j_end = j;
    while (i_end < a.size() && digit(a[i_end])) ++i_end;
    while (j_end < b.size() && digit(b[j_end])) ++j_end;
    while (i < i_end - 1 && a[i] == '0') ++i;
    while (j < j_end - 1 && b[j] == '0') ++j;
    if (i_end - i != j_end - j) return i_end - i < j_end - j;
    const int order = a.compare(i, i_end - i, b, j, j_end - j);
    if (order != 0) return order < 0;
    i = i_end, j = j_end;
  }
  return a.size() - i < b.size() - j;
}

// Copies `slice` into layer k of `volume`, which takes the first slice's type and size.
Result<void> put_slice(AnyImage& volume, const AnyImage& slice, int k, const fs::path& file) {
  return std::visit(
      [&]<typename T>(Image<T>& out) -> Result<void> {
        const Image<T>* in = std::get_if<Image<T>>(&slice);
        if (in == nullptr)
          return bad(file, "slice has another pixel type", std::string(pixel_type_name(slice)),
                     "all slices must have that of the first");
        if (in->grid.size[0] != out.grid.size[0] || in->grid.size[1] != out.grid.size[1])
          return bad(file, "slice has another size",
                     fmt::format("{}x{}", in->grid.size[0], in->grid.size[1]),
                     fmt::format("the first has {}x{}", out.grid.size[0], out.grid.size[1]));
        std::copy(in->voxels.begin(), in->voxels.end(),
                  out.voxels.begin() + std::ssize(in->voxels) * k);
        return {};
      },
      volume);
}

// The files' slices one above the other; the grid is the first slice's with its third axis unset.
Result<AnyImage> stacked(const std::vector<fs::path>& files, Format format,
                         const Progress& progress) {
  AnyImage volume;
  for (std::size_t k = 0; k < files.size(); ++k) {
    if (progress.should_stop()) return fail(cancelled("read"));
    progress.at("read", static_cast<double>(k) / static_cast<double>(files.size()));
    Result<AnyImage> slice = read_one(files[k], format, 2);
    if (!slice) return fail(slice.error());
    if (k == 0)
      std::visit(
          [&]<typename T>(const Image<T>& s) {
            ImageGrid grid = s.grid;
            grid.size[2] = static_cast<int>(files.size());
            volume = Image<T>(grid);
          },
          *slice);
    const Result<void> put = put_slice(volume, *slice, static_cast<int>(k), files[k]);
    if (!put) return fail(put.error());
  }
  return volume;
}

Result<ImageFile> read_picture_stack(std::vector<fs::path> files, Format format,
                                     const fs::path& folder, const ReadImageOptions& options,
                                     const Progress& progress) {
  if (files.size() < 2)
    return bad(folder, "folder holds a single slice", files.front().filename().string(),
               "a stack needs at least two");
  std::sort(files.begin(), files.end(), [](const fs::path& a, const fs::path& b) {
    return natural_less(a.filename().string(), b.filename().string());
  });
  return stacked(files, format, progress).map([&](AnyImage image) {
    std::vector<std::string> notes;
    set_stack_geometry(image, options, notes);
    return with_report(std::move(image), fmt::format("{} stack", title(format)), std::move(notes));
  });
}

// ---- DICOM ------------------------------------------------------------------------------------

Result<DicomSeries> chosen_series(std::vector<DicomSeries> all, const fs::path& folder,
                                  const std::string& uid) {
  if (all.empty())
    return bad(folder, "folder holds no image", {},
               "it must hold one DICOM series, or slices .png or .tif");
  if (uid.empty() && all.size() == 1) return std::move(all.front());
  for (DicomSeries& s : all)
    if (!uid.empty() && s.uid == uid) return std::move(s);
  std::vector<std::string> listed;
  for (const DicomSeries& s : all)
    listed.push_back(fmt::format("{} ({} slices)", s.uid, s.files.size()));
  return bad(folder, uid.empty() ? "folder holds several DICOM series" : "no such DICOM series",
             uid.empty() ? fmt::format("{}", all.size()) : uid,
             fmt::format("choose one of {}", fmt::join(listed, ", ")));
}

struct Slice {
  fs::path file;
  ImageGrid grid;
  double height_mm = 0;  // along the normal of the first slice
};

// Slices in order of height, at even distances. Error: two at one height, or a gap.
Result<double> slice_distance(const std::vector<Slice>& slices) {
  std::vector<double> gaps;
  for (std::size_t k = 1; k < slices.size(); ++k)
    gaps.push_back(slices[k].height_mm - slices[k - 1].height_mm);
  std::vector<double> sorted = gaps;
  std::nth_element(sorted.begin(), sorted.begin() + std::ssize(sorted) / 2, sorted.end());
  const double usual = sorted[sorted.size() / 2];
  // Scanners round positions to a few micrometres; a tenth of the distance is far above that and
  // far below a missing slice.
  for (std::size_t k = 0; k < gaps.size(); ++k) {
    const std::string place = slices[k + 1].file.filename().string();
    if (gaps[k] <= 0.1 * usual)
      return bad(slices[k + 1].file, "two slices are at the same place",
                 fmt::format("{} and {}", slices[k].file.filename().string(), place),
                 "a series has one slice a position");
    if (std::abs(gaps[k] - usual) > 0.1 * usual)
      return bad(slices[k + 1].file, "slices are not at even distances",
                 fmt::format("{:.4g} mm between {} and {}", gaps[k],
                             slices[k].file.filename().string(), place),
                 fmt::format("the others are {:.4g} mm apart: is a slice missing?", usual));
  }
  return (slices.back().height_mm - slices.front().height_mm) /
         static_cast<double>(slices.size() - 1);
}

Result<std::vector<Slice>> sorted_slices(const DicomSeries& series) {
  std::vector<Slice> slices;
  for (const std::string& file : series.files) {
    const Result<Description> d = describe(file, Format::kDicom);
    if (!d) return fail(d.error());
    slices.push_back({file, d->grid, 0});
  }
  const Vec3 normal =
      slices.front().grid.direction.col(0).cross(slices.front().grid.direction.col(1));
  for (Slice& s : slices) {
    if (!s.grid.direction.isApprox(slices.front().grid.direction,
                                   1e-3))  // direction cosines carry 4 digits or more
      return bad(s.file, "slice is turned against the others", {},
                 "the slices of a series are parallel");
    s.height_mm = normal.dot(s.grid.origin_mm);
  }
  std::stable_sort(slices.begin(), slices.end(),
                   [](const Slice& a, const Slice& b) { return a.height_mm < b.height_mm; });
  return slices;
}

Result<ImageFile> read_dicom_series(const fs::path& folder, const ReadImageOptions& options,
                                    const Progress& progress) {
  auto series = dicom_series(folder).and_then([&](std::vector<DicomSeries> all) {
    return chosen_series(std::move(all), folder, options.series_uid);
  });
  if (!series) return fail(series.error());
  if (series->files.size() == 1)
    return read_one(series->files.front(), Format::kDicom, 3).map([](AnyImage image) {
      return with_report(std::move(image), "DICOM", {});
    });
  const Result<std::vector<Slice>> slices = sorted_slices(*series);
  if (!slices) return fail(slices.error());
  const Result<double> distance = slice_distance(*slices);
  if (!distance) return fail(distance.error());
  std::vector<fs::path> files;
  for (const Slice& s : *slices) files.push_back(s.file);
  Result<AnyImage> volume = stacked(files, Format::kDicom, progress);
  if (!volume) return fail(volume.error());
  const ImageGrid first = slices->front().grid;
  const Vec3 run = slices->back().grid.origin_mm - first.origin_mm;
  ImageGrid& grid = mutable_grid(*volume);
  grid.spacing_mm[2] = *distance;
  grid.direction.col(2) = first.direction.col(0).cross(first.direction.col(1));
  std::vector<std::string> notes;
  // A tilted gantry shears the stack: positions drift sideways from slice to slice.
  const double sideways = (run - run.dot(grid.direction.col(2)) * grid.direction.col(2)).norm();
  if (sideways > 0.5 * grid.spacing_mm.minCoeff())
    return bad(folder, "slices are sheared (tilted gantry)",
               fmt::format("{:.4g} mm over the series", sideways),
               "slices must be stacked along their normal: resample the series first");
  return checked(grid, folder).map([&](const ImageGrid& sound) {
    mutable_grid(*volume) = sound;
    return with_report(std::move(*volume), "DICOM series", std::move(notes));
  });
}

Result<ImageFile> read_folder(const fs::path& folder, const ReadImageOptions& options,
                              const Progress& progress) {
  std::vector<fs::path> pngs, tiffs;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const Suffix* s = suffix_of(entry.path());
    if (s != nullptr && s->format == Format::kPng) pngs.push_back(entry.path());
    if (s != nullptr && s->format == Format::kTiff) tiffs.push_back(entry.path());
  }
  if (error) return bad(folder, "folder cannot be read", error.message());
  if (!pngs.empty() && !tiffs.empty())
    return bad(folder, "folder mixes PNG and TIFF slices",
               fmt::format("{} and {}", pngs.size(), tiffs.size()), "a stack is of one kind");
  if (!pngs.empty())
    return read_picture_stack(std::move(pngs), Format::kPng, folder, options, progress);
  if (!tiffs.empty())
    return read_picture_stack(std::move(tiffs), Format::kTiff, folder, options, progress);
  return read_dicom_series(folder, options, progress);
}

Error unknown_suffix(const fs::path& path) {
  return {ErrorKind::kBadInput,
          "image format is not known by its suffix",
          path.string(),
          {},
          ".nii .nii.gz .nrrd .nhdr .mha .mhd .vti .tif .tiff .dcm or a folder are read"};
}

template <typename T>
Result<void> write_by_suffix(const Image<T>& image, const fs::path& path) {
  const Suffix* s = suffix_of(path);
  if (!is_vti(path) && (s == nullptr || !s->writes))
    return fail({ErrorKind::kCannotWrite,
                 "image format is not written",
                 path.string(),
                 {},
                 ".nii .nii.gz .nrrd .mha .vti .tif .tiff are"});
  return write_atomically(path, [&](const fs::path& temporary) {
    Result<void> written =
        is_vti(path) ? write_vti(image, temporary) : write(image, temporary, s->format);
    if (!written) written.error().where = path.string();
    return written;
  });
}

}  // namespace

namespace image_formats {

Result<ImageGrid> checked(ImageGrid grid, const fs::path& path) {
  for (int i = 0; i < 3; ++i)
    if (!(grid.spacing_mm[i] > 0) || !std::isfinite(grid.spacing_mm[i]))
      return bad(path, fmt::format("spacing of axis {} is not positive", i),
                 fmt::format("{}", grid.spacing_mm[i]), "spacing must be positive");
  if (!grid.origin_mm.allFinite())
    return bad(path, "origin is not finite", {}, "the position of the first voxel must be finite");
  const Mat3 gram = grid.direction.transpose() * grid.direction;
  // Files keep direction cosines with four digits or more; more than that is a sheared grid.
  if (!grid.direction.allFinite() || !gram.isIdentity(1e-3))
    return bad(path, "axes of the image are not orthogonal", {},
               "the direction must be a rotation or reflection: resample the image");
  const Eigen::JacobiSVD<Mat3> svd(grid.direction, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Mat3 nearest = svd.matrixU() * svd.matrixV().transpose();
  if (!grid.direction.isIdentity(0)) grid.direction = nearest;
  return grid;
}

}  // namespace image_formats

Result<ImageFile> read_image(const fs::path& path, const ReadImageOptions& options,
                             const Progress& progress) {
  if (const auto present = check_present(path); !present) return fail(present.error());
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) return read_folder(path, options, progress);
  progress.at("read", 0);
  if (is_vti(path))
    return read_vti(path).and_then([&](AnyImage image) -> Result<ImageFile> {
      const Voxel n = grid_of(image).size;
      const Description d{{n[0], n[1], n[2]}, 1, grid_of(image)};
      if (const auto ok = check_axes(d, path, 3); !ok) return fail(ok.error());
      return with_report(std::move(image), "VTI", {"VTI names no world: taken as LPS"});
    });
  const Suffix* s = suffix_of(path);
  if (s == nullptr || !s->reads) return fail(unknown_suffix(path));
  std::vector<std::string> notes;
  return read_checked(path, s->format, 3, notes).map([&](AnyImage image) {
    if (s->format == Format::kTiff) set_stack_geometry(image, options, notes);
    return with_report(std::move(image), title(s->format), std::move(notes));
  });
}

Result<ImageFile> read_flat_image(const fs::path& path, const ReadImageOptions& options) {
  if (const auto present = check_present(path); !present) return fail(present.error());
  const Suffix* s = suffix_of(path);
  if (s == nullptr) return fail(unknown_suffix(path));
  std::vector<std::string> notes;
  return read_checked(path, s->format, 2, notes).map([&](AnyImage image) {
    if (s->format == Format::kTiff || s->format == Format::kPng)
      set_stack_geometry(image, options, notes);
    return with_report(std::move(image), title(s->format), std::move(notes));
  });
}

template <typename T>
Result<void> write_image(const Image<T>& image, const fs::path& path) {
  return write_by_suffix(image, path);
}

Result<void> write_image(const AnyImage& image, const fs::path& path) {
  return std::visit([&](const auto& i) { return write_by_suffix(i, path); }, image);
}

template Result<void> write_image(const Image<std::uint8_t>&, const fs::path&);
template Result<void> write_image(const Image<std::int8_t>&, const fs::path&);
template Result<void> write_image(const Image<std::uint16_t>&, const fs::path&);
template Result<void> write_image(const Image<std::int16_t>&, const fs::path&);
template Result<void> write_image(const Image<std::uint32_t>&, const fs::path&);
template Result<void> write_image(const Image<std::int32_t>&, const fs::path&);
template Result<void> write_image(const Image<float>&, const fs::path&);
template Result<void> write_image(const Image<double>&, const fs::path&);

}  // namespace angiospline
