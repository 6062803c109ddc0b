#include <memory>

#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/options.h"
#include "pipeline/report_json.h"
#include "pipeline/segment_file.h"

namespace angiospline::cli {
namespace {

struct Arguments {
  std::filesystem::path image;
  std::filesystem::path mask;
  MultimodalFileOptions options;  // of which one modality takes the image's alone
  bool json = false;
};

int run_with_views(const Arguments& arguments) {
  const Console console;
  const auto grown =
      segment_with_views(arguments.image, arguments.mask, arguments.options, console.progress());
  if (!grown) return report_error(grown.error());
  if (arguments.json) print_json(json_text(*grown));
  const MultimodalReport& report = grown->report;
  console.say(fmt::format(
      "{} vessel voxels: {} by both modalities, {} by the volume alone, {} by "
      "the views alone -> {}",
      report.voxels, report.by_both, report.by_volume, report.by_views, arguments.mask.string()));
  return kSuccess;
}

int run(const Arguments& arguments) {
  if (!arguments.options.views.empty()) return run_with_views(arguments);
  const Console console;
  const auto segmented =
      segment_to_file(arguments.image, arguments.mask, arguments.options.image, console.progress());
  if (!segmented) return report_error(segmented.error());
  if (arguments.json) print_json(json_text(*segmented));
  const SegmentReport& report = segmented->report;
  for (const std::string& text : report.choices) console.say("note: " + text);
  for (const Warning& warning : report.warnings) console.warn(warning);
  console.say(fmt::format("{} vessel voxels of {} examined, {} more filled -> {}",
                          report.grown.voxels, report.grown.examined, report.filled_voxels,
                          arguments.mask.string()));
  return kSuccess;
}

}  // namespace

void add_segment(CommandLine& line) {
  const auto arguments = std::make_shared<Arguments>();
  Arguments& a = *arguments;
  const Command command = line.command("segment", "grow the vessel from seeds: image to mask");
  add_segment_options(command, a.image, a.options.image);
  command.add("-o,--output", a.mask, "mask image to write").required();
  command.add("--xray", a.options.views,
              "JSON file of X-ray views: growing in IMAGE and all of them together; needs "
              "--seed and --background");
  command
      .add("--world-spacing", a.options.voxel_mm,
           "voxel edge of the mask in mm, with --xray (default: half of IMAGE's)")
      .positive();
  add_json_flag(command, a.json);
  command.runs([arguments] { return run(*arguments); });
}

}  // namespace angiospline::cli
