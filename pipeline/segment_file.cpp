#include "pipeline/segment_file.h"

#include <algorithm>
#include <string>
#include <utility>
#include <variant>

#include "io/images/xray_geometry_file.h"
#include "recovery/imaging/segment/label_map.h"

namespace angiospline {
namespace {

Image<float> in_float(const AnyImage& image) {
  Image<float> out(grid_of(image));
  std::visit(
      [&](const auto& typed) {
        std::transform(typed.voxels.begin(), typed.voxels.end(), out.voxels.begin(),
                       [](auto v) { return static_cast<float>(v); });
      },
      image);
  return out;
}

// Seeds in voxels join those in mm.
SegmentOptions segment_options(const SegmentFileOptions& options, const ImageGrid& grid) {
  SegmentOptions on_grid = options.segment;
  for (const Vec3& seed : options.seeds_vox) on_grid.seeds_mm.push_back(grid.world_mm(seed));
  return on_grid;
}

MultimodalOptions multimodal_options(const SegmentOptions& asked) {
  MultimodalOptions options;
  options.volume.polarity = asked.polarity;
  options.volume.neighbourhood_vox =
      asked.neighbourhood_vox.value_or(options.volume.neighbourhood_vox);
  options.volume.deviations = asked.deviations.value_or(options.volume.deviations);

  // The background is a grey value of the volume, which guides the views.
  options.projection = options.volume;
  options.volume.background = asked.background;
  options.max_examined = asked.max_examined;
  return options;
}

Result<MultimodalSegmentation> grow_with_views(const std::filesystem::path& image,
                                               const MultimodalFileOptions& options,
                                               const Progress& progress) {
  const SegmentFileOptions& asked = options.image;
  if ((asked.segment.seeds_mm.empty() && asked.seeds_vox.empty()) || !asked.segment.background) {
    return fail({ErrorKind::kBadInput,
                 "growing with X-ray views needs more",
                 options.views.string(),
                 {},
                 "give --seed and --background"});
  }
  auto views = read_xray_views(options.views);
  if (!views) return fail(views.error());
  const auto file = read_image(image, asked.reading, progress);
  if (!file) return fail(file.error());

  const ImageGrid& grid = grid_of(file->image);
  const SegmentOptions on_grid = segment_options(asked, grid);
  const double edge = options.voxel_mm.value_or(0.5 * grid.spacing_mm.minCoeff());
  return grow_region(Modalities{in_float(file->image), std::move(*views)}, finer_grid(grid, edge),
                     on_grid.seeds_mm, multimodal_options(on_grid), progress);
}

}  // namespace

Result<Segmented> segment_image(const AnyImage& image, const std::string& source,
                                const SegmentFileOptions& options, const Progress& progress) {
  auto segmented = segment(image, segment_options(options, grid_of(image)), progress);
  if (segmented || segmented.error().kind == ErrorKind::kCancelled) return segmented;
  Error error = segmented.error();
  error.where = error.where.empty() ? source : source + ": " + error.where;
  return fail(std::move(error));
}

Result<SegmentedFile> segment_file(const std::filesystem::path& image,
                                   const SegmentFileOptions& options, const Progress& progress,
                                   Stopwatch& watch) {
  auto file = read_image(image, options.reading, progress);
  if (!file) return fail(file.error());
  watch.lap("read");

  auto segmented = segment_image(file->image, image.string(), options, progress);
  if (!segmented) return fail(segmented.error());
  std::vector<std::string>& choices = segmented->report.choices;
  choices.insert(choices.begin(), file->notes.begin(), file->notes.end());
  watch.lap("segment");
  return SegmentedFile{std::move(file->image), *std::move(segmented)};
}

Result<WrittenMask> segment_to_file(const std::filesystem::path& image,
                                    const std::filesystem::path& mask,
                                    const SegmentFileOptions& options, const Progress& progress) {
  Stopwatch watch;
  auto file = segment_file(image, options, progress, watch);
  if (!file) return fail(file.error());
  if (auto written = write_image(file->segmented.mask, mask); !written) {
    return fail(written.error());
  }
  watch.lap("write");
  return WrittenMask{std::move(file->segmented.report), watch.laps()};
}

Result<WrittenMultimodalMask> segment_with_views(const std::filesystem::path& image,
                                                 const std::filesystem::path& mask,
                                                 const MultimodalFileOptions& options,
                                                 const Progress& progress) {
  Stopwatch watch;
  const auto grown = grow_with_views(image, options, progress);
  if (!grown) return fail(grown.error());
  watch.lap("segment");
  if (auto written = write_image(grown->mask, mask); !written) return fail(written.error());
  watch.lap("write");
  return WrittenMultimodalMask{grown->report, watch.laps()};
}

Result<Mask> read_mask(const std::filesystem::path& path, const Progress& progress) {
  const auto file = read_image(path, {}, progress);
  if (!file) return fail(file.error());
  return mask_from_image(file->image, path.string());
}

Result<Mask> read_level_set(const std::filesystem::path& path, const Progress& progress) {
  const auto file = read_image(path, {}, progress);
  if (!file) return fail(file.error());
  return mask_from_level_set(file->image, path.string());
}

}  // namespace angiospline
