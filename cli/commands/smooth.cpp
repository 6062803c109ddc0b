#include "pipeline/smooth.h"

#include <memory>
#include <vector>

#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/options.h"
#include "cli/outcome.h"
#include "pipeline/report_json.h"

namespace angiospline::cli {
namespace {

struct Arguments {
  std::filesystem::path model;
  std::vector<std::filesystem::path> outputs;
  SmoothFileOptions options;
  bool json = false;
};

// The parts that were refused; true if there are none.
bool tell_parts(const SmoothedFile& smoothed, const Console& console) {
  int moved = 0;
  int refused = 0;
  for (const SmoothedPart& part : smoothed.parts) {
    moved += part.outcome == SmoothedPart::Outcome::kSmoothed;
    if (part.outcome != SmoothedPart::Outcome::kRefused) continue;
    ++refused;
    console.say(fmt::format("refused: {}: {}", part.name, part.why));
  }
  console.say(fmt::format(
      "{} of {} parts smoothed, {} refused: largest normal angle {:.3g} -> {:.3g} degrees", moved,
      smoothed.parts.size(), refused, smoothed.before_deg, smoothed.after_deg));
  return refused == 0;
}

int run(const Arguments& arguments) {
  const Console console;
  const auto smoothed =
      smooth_file(arguments.model, arguments.outputs, arguments.options, console.progress());
  if (!smoothed) return report_error(smoothed.error());
  const bool all = tell_parts(*smoothed, console);
  if (arguments.json) print_json(json_text(*smoothed));
  const int outcome =
      tell_outcome(smoothed->model, smoothed->certificate, smoothed->files, console);
  return all ? outcome : kFailure;
}

}  // namespace

void add_smooth(CommandLine& line) {
  const auto arguments = std::make_shared<Arguments>();
  Arguments& a = *arguments;
  const Command command =
      line.command("smooth", "make a native model tangent-plane continuous again");
  command.add("MODEL", a.model, "native model (.json)").required();
  command.add("-o,--output", a.outputs, "files to write, by suffix").required();
  command
      .add("--tolerance", a.options.smooth.clean_deg,
           "parts whose normals nowhere differ by more degrees are left as they are")
      .positive();
  command.flag("--all", a.options.smooth.everything, "smooth every part, clean or not");
  add_writing_options(command, a.options.writing);
  add_json_flag(command, a.json);
  command.runs([arguments] { return run(*arguments); });
}

}  // namespace angiospline::cli
