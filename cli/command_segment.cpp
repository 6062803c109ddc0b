#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/figures.h"

namespace angiospline::cli {

int run_segment(const SegmentArguments& arguments) {
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
  for (const std::string& text : report.warnings) console.warn(text);
  console.say(fmt::format("{} vessel voxels of {} examined, {} more filled -> {}",
                          report.grown.voxels, report.grown.examined, report.filled_voxels,
                          arguments.output));
  return kSuccess;
}

}  // namespace angiospline::cli
