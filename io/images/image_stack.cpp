#include "io/images/image_stack.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "io/images/image_file_formats.h"
#include "io/images/rules.h"

namespace angiospline::image_formats {
namespace fs = std::filesystem;

namespace {

ImageGrid& mutable_grid(AnyImage& image) {
  return std::visit([](auto& i) -> ImageGrid& { return i.grid; }, image);
}

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

    // Leading zeros count for nothing; then the longer number is the larger.
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
          return bad_image(file, "slice has another pixel type",
                           std::string(pixel_type_name(slice)),
                           "all slices must have that of the first");
        if (in->grid.size[0] != out.grid.size[0] || in->grid.size[1] != out.grid.size[1])
          return bad_image(file, "slice has another size",
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

Result<ImageStack> read_picture_stack(std::vector<fs::path> files, Format format,
                                      const fs::path& folder, const ReadImageOptions& options,
                                      const Progress& progress) {
  if (files.size() < 2)
    return bad_image(folder, "folder holds a single slice", files.front().filename().string(),
                     "a stack needs at least two");
  std::sort(files.begin(), files.end(), [](const fs::path& a, const fs::path& b) {
    return natural_less(a.filename().string(), b.filename().string());
  });
  return stacked(files, format, progress).map([&](AnyImage image) {
    std::vector<std::string> notes;
    set_stack_geometry(image, options, notes);
    return ImageStack{std::move(image), fmt::format("{} stack", title(format)), std::move(notes)};
  });
}

Result<DicomSeries> chosen_series(std::vector<DicomSeries> all, const fs::path& folder,
                                  const std::string& uid) {
  if (all.empty())
    return bad_image(folder, "folder holds no image", {},
                     "it must hold one DICOM series, or slices .png or .tif");
  if (uid.empty() && all.size() == 1) return std::move(all.front());
  for (DicomSeries& s : all)
    if (!uid.empty() && s.uid == uid) return std::move(s);
  std::vector<std::string> listed;
  for (const DicomSeries& s : all)
    listed.push_back(fmt::format("{} ({} slices)", s.uid, s.files.size()));
  return bad_image(folder,
                   uid.empty() ? "folder holds several DICOM series" : "no such DICOM series",
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

  for (std::size_t k = 0; k < gaps.size(); ++k) {
    const std::string place = slices[k + 1].file.filename().string();
    if (gaps[k] <= kSliceDistanceSlack * usual)
      return bad_image(slices[k + 1].file, "two slices are at the same place",
                       fmt::format("{} and {}", slices[k].file.filename().string(), place),
                       "a series has one slice a position");
    if (std::abs(gaps[k] - usual) > kSliceDistanceSlack * usual)
      return bad_image(slices[k + 1].file, "slices are not at even distances",
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

  // Heights of Image Position (Patient) over the first slice's plane (DICOM PS3.3, C.7.6.2.1.1).
  const Vec3 normal =
      slices.front().grid.direction.col(0).cross(slices.front().grid.direction.col(1));
  for (Slice& s : slices) {
    if (!s.grid.direction.isApprox(slices.front().grid.direction, kDirectionRounding))
      return bad_image(s.file, "slice is turned against the others", {},
                       "the slices of a series are parallel");
    s.height_mm = normal.dot(s.grid.origin_mm);
  }
  std::stable_sort(slices.begin(), slices.end(),
                   [](const Slice& a, const Slice& b) { return a.height_mm < b.height_mm; });
  return slices;
}

Result<ImageStack> read_dicom_series(const fs::path& folder, const ReadImageOptions& options,
                                     const Progress& progress) {
  auto series = dicom_series(folder).and_then([&](std::vector<DicomSeries> all) {
    return chosen_series(std::move(all), folder, options.series_uid);
  });
  if (!series) return fail(series.error());
  if (series->files.size() == 1)
    return read_one(series->files.front(), Format::kDicom, 3).map([](AnyImage image) {
      return ImageStack{std::move(image), "DICOM", {}};
    });

  const Result<std::vector<Slice>> slices = sorted_slices(*series);
  if (!slices) return fail(slices.error());
  const Result<double> distance = slice_distance(*slices);
  if (!distance) return fail(distance.error());
  std::vector<fs::path> files;
  for (const Slice& s : *slices) files.push_back(s.file);
  Result<AnyImage> volume = stacked(files, Format::kDicom, progress);
  if (!volume) return fail(volume.error());

  // Slices know their own plane; the third axis comes from their positions.
  const ImageGrid first = slices->front().grid;
  const Vec3 run = slices->back().grid.origin_mm - first.origin_mm;
  ImageGrid& grid = mutable_grid(*volume);
  grid.spacing_mm[2] = *distance;
  grid.direction.col(2) = first.direction.col(0).cross(first.direction.col(1));

  // A tilted gantry shears the stack: positions drift sideways from slice to slice.
  const double sideways = (run - run.dot(grid.direction.col(2)) * grid.direction.col(2)).norm();
  if (sideways > kLargestDrift * grid.spacing_mm.minCoeff())
    return bad_image(folder, "slices are sheared (tilted gantry)",
                     fmt::format("{:.4g} mm over the series", sideways),
                     "slices must be stacked along their normal: resample the series first");
  return checked(grid, folder).map([&](const ImageGrid& sound) {
    mutable_grid(*volume) = sound;
    return ImageStack{std::move(*volume), "DICOM series", {}};
  });
}

}  // namespace

void set_stack_geometry(AnyImage& image, const ReadImageOptions& options,
                        std::vector<std::string>& notes) {
  ImageGrid& grid = mutable_grid(image);
  grid.spacing_mm = options.stack_spacing_mm.value_or(Vec3::Ones());
  grid.origin_mm.setZero();
  grid.direction.setIdentity();
  if (!options.stack_spacing_mm)
    notes.push_back("the stack carries no spacing: 1 x 1 x 1 mm is assumed");
}

Result<ImageStack> read_image_folder(const fs::path& folder, const ReadImageOptions& options,
                                     const Progress& progress) {
  std::vector<fs::path> pngs, tiffs;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const ImageSuffix* s = suffix_of(entry.path());
    if (s != nullptr && s->format == Format::kPng) pngs.push_back(entry.path());
    if (s != nullptr && s->format == Format::kTiff) tiffs.push_back(entry.path());
  }

  if (error) return bad_image(folder, "folder cannot be read", error.message());
  if (!pngs.empty() && !tiffs.empty())
    return bad_image(folder, "folder mixes PNG and TIFF slices",
                     fmt::format("{} and {}", pngs.size(), tiffs.size()), "a stack is of one kind");
  if (!pngs.empty())
    return read_picture_stack(std::move(pngs), Format::kPng, folder, options, progress);
  if (!tiffs.empty())
    return read_picture_stack(std::move(tiffs), Format::kTiff, folder, options, progress);
  return read_dicom_series(folder, options, progress);
}

}  // namespace angiospline::image_formats
