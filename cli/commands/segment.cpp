#include <algorithm>

#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/figures.h"
#include "cli/stages.h"
#include "io/images/xray_geometry_file.h"
#include "recovery/imaging/segment/multimodal.h"

namespace angiospline::cli {

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

Result<MultimodalSegmentation> grow_with_views(const SegmentArguments& arguments,
                                               const Progress& progress) {
  if ((arguments.seeds_mm.empty() && arguments.seeds_vox.empty()) || !arguments.background)
    return fail({ErrorKind::kBadInput,
                 "growing with X-ray views needs more",
                 arguments.xray,
                 {},
                 "give --seed and --background"});
  auto views = read_xray_views(arguments.xray);
  if (!views) return fail(views.error());
  const auto file = read_image(arguments.image, reading_of(arguments), progress);
  if (!file) return fail(file.error());
  const ImageGrid& grid = grid_of(file->image);
  MultimodalOptions options;
  options.volume.polarity = arguments.dark ? Polarity::kDark : Polarity::kBright;
  options.volume.neighbourhood_vox =
      arguments.neighborhood.value_or(options.volume.neighbourhood_vox);
  options.volume.deviations = arguments.deviations.value_or(options.volume.deviations);
  options.projection = options.volume;
  options.volume.background = arguments.background;
  if (arguments.limit) options.max_examined = static_cast<std::size_t>(*arguments.limit);
  std::vector<Vec3> seeds = arguments.seeds_mm;
  for (const Vec3& seed : arguments.seeds_vox) seeds.push_back(grid.world_mm(seed));
  const double edge = arguments.world_spacing_mm.value_or(0.5 * grid.spacing_mm.minCoeff());
  Modalities images{in_float(file->image), std::move(*views)};
  return grow_region(std::move(images), finer_grid(grid, edge), seeds, options, progress);
}

int segment_with_views(const SegmentArguments& arguments) {
  const Console console;
  Stopwatch watch;
  const auto grown = grow_with_views(arguments, console.progress());
  if (!grown) return report_error(grown.error());
  watch.lap("segment");
  if (const auto written = write_image(grown->mask, arguments.output); !written) {
    return report_error(written.error());
  }
  watch.lap("write");
  const MultimodalReport& report = grown->report;
  if (arguments.json) {
    print_json({{"voxels", report.voxels},
                {"examined", report.examined},
                {"by_volume", report.by_volume},
                {"by_views", report.by_views},
                {"by_both", report.by_both},
                {"limit_reached", report.limit_reached},
                {"seconds", seconds_json(watch)}});
  }
  console.say(fmt::format(
      "{} vessel voxels: {} by both modalities, {} by the volume alone, {} by "
      "the views alone -> {}",
      report.voxels, report.by_both, report.by_volume, report.by_views, arguments.output));
  return kSuccess;
}

}  // namespace

int run_segment(const SegmentArguments& arguments) {
  if (!arguments.xray.empty()) return segment_with_views(arguments);
  const Console console;
  Stopwatch watch;
  const auto segmented = segment_image(arguments, console.progress(), watch);
  if (!segmented) return report_error(segmented.error());
  if (const auto written = write_image(segmented->mask, arguments.output); !written) {
    return report_error(written.error());
  }
  watch.lap("write");
  const SegmentReport& report = segmented->report;
  if (arguments.json) {
    Json json = segmentation_json(report);
    json["seconds"] = seconds_json(watch);
    print_json(json);
  }
  for (const std::string& text : report.choices) console.say("note: " + text);
  for (const Warning& warning : report.warnings) console.warn(warning);
  console.say(fmt::format("{} vessel voxels of {} examined, {} more filled -> {}",
                          report.grown.voxels, report.grown.examined, report.filled_voxels,
                          arguments.output));
  return kSuccess;
}

}  // namespace angiospline::cli
