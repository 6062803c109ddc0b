#include "cli/stages.h"

#include <cmath>
#include <utility>

namespace angiospline::cli {
namespace {

SegmentOptions segment_options(const SegmentArguments& arguments, const ImageGrid& grid) {
  SegmentOptions options;
  options.seeds_mm = arguments.seeds_mm;
  for (const Vec3& seed : arguments.seeds_vox) options.seeds_mm.push_back(grid.world_mm(seed));
  if (arguments.dark) options.polarity = Polarity::kDark;
  options.neighbourhood_vox = arguments.neighborhood;
  options.deviations = arguments.deviations;
  options.background = arguments.background;
  if (arguments.smoothing_vox) options.smoothing_vox = *arguments.smoothing_vox;
  options.cut_swellings = arguments.cut_swellings;
  if (arguments.limit) options.max_examined = static_cast<std::size_t>(*arguments.limit);
  return options;
}

}  // namespace

ReadImageOptions reading_of(const SegmentArguments& arguments) {
  ReadImageOptions options;
  options.series_uid = arguments.series_uid;
  options.stack_spacing_mm = arguments.stack_spacing_mm;
  return options;
}

void Stopwatch::lap(std::string stage) {
  const auto now = std::chrono::steady_clock::now();
  laps_.emplace_back(std::move(stage), std::chrono::duration<double>(now - last_).count());
  last_ = now;
}

Result<Segmented> segment_image(const SegmentArguments& arguments, const Progress& progress,
                                Stopwatch& watch) {
  auto file = read_image(arguments.image, reading_of(arguments), progress);
  if (!file) return fail(file.error());
  watch.lap("read");
  const SegmentOptions options = segment_options(arguments, grid_of(file->image));
  auto segmented = segment(std::move(file->image), options, progress);
  if (!segmented) {
    Error error = segmented.error();
    if (error.kind != ErrorKind::kCancelled) {
      error.where = error.where.empty() ? arguments.image : arguments.image + ": " + error.where;
    }
    return fail(std::move(error));
  }
  std::vector<std::string>& choices = segmented->report.choices;
  choices.insert(choices.begin(), file->notes.begin(), file->notes.end());
  watch.lap("segment");
  return segmented;
}

namespace {

template <typename Inside>
Result<Mask> mask_where(const AnyImage& image, const Inside& inside, const Error& none) {
  Mask mask(grid_of(image));
  bool any = false;
  std::visit(
      [&](const auto& typed) {
        for (std::size_t i = 0; i < typed.voxels.size(); ++i) {
          mask.voxels[i] = inside(typed.voxels[i]) ? 1 : 0;
          any = any || mask.voxels[i] != 0;
        }
      },
      image);
  if (!any) return fail(none);
  return mask;
}

}  // namespace

Result<Mask> mask_from_image(const AnyImage& image, const std::string& file) {
  return mask_where(image, [](auto v) { return v != 0 && std::isfinite(static_cast<double>(v)); },
                    {ErrorKind::kBadInput, "mask is empty", file, "all voxels are zero",
                     "a mask has voxels that are not zero inside the vessel"});
}

Result<Mask> mask_from_level_set(const AnyImage& image, const std::string& file) {
  return mask_where(image, [](auto v) { return static_cast<double>(v) < 0; },
                    {ErrorKind::kBadInput, "level set is empty", file, "no voxel is below 0",
                     "a level set is negative inside the vessel"});
}

}  // namespace angiospline::cli
