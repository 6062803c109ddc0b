#include <filesystem>
#include <variant>

#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/figures.h"
#include "cli/model_stages.h"
#include "cli/stages.h"
#include "io/model/certificate_json.h"
#include "modeling/continuity/smooth_network.h"

namespace angiospline::cli {
namespace {

const char* word(SmoothedPart::Outcome outcome) {
  switch (outcome) {
    case SmoothedPart::Outcome::kClean:
      return "clean";
    case SmoothedPart::Outcome::kSmoothed:
      return "smoothed";
    case SmoothedPart::Outcome::kRefused:
      break;
  }
  return "refused";
}

Json smoothing_json(const SmoothedNetwork& smoothed) {
  Json parts = Json::array();
  for (const SmoothedPart& part : smoothed.parts) {
    Json json{{"name", part.name},
              {"outcome", word(part.outcome)},
              {"before_deg", part.before_deg},
              {"after_deg", part.after_deg},
              {"moved_mm", part.moved_mm}};
    if (!part.why.empty()) json["why"] = part.why;
    parts.push_back(std::move(json));
  }
  return {{"before_deg", smoothed.before_deg}, {"after_deg", smoothed.after_deg}, {"parts", parts}};
}

Result<Model> read_native(const std::string& file, const Progress& progress) {
  auto any = read_any_model(file, progress);
  if (!any) return fail(any.error());
  if (auto* model = std::get_if<Model>(&*any)) return std::move(*model);
  return fail(
      {ErrorKind::kBadInput,
       "not a native model",
       file,
       {},
       "only .json models know which patches belong together; write one with seed -o x.json"});
}

// The parts that were refused; true if there are none.
bool tell_parts(const SmoothedNetwork& smoothed, Model& model, const Console& console) {
  int moved = 0;
  int refused = 0;
  for (const SmoothedPart& part : smoothed.parts) {
    moved += part.outcome == SmoothedPart::Outcome::kSmoothed;
    if (part.outcome != SmoothedPart::Outcome::kRefused) continue;
    ++refused;
    console.say(fmt::format("refused: {}: {}", part.name, part.why));
    model.warnings.push_back({WarningCode::kPartNotSmoothed,
                              fmt::format("{} could not be smoothed: {}", part.name, part.why)});
  }
  console.say(fmt::format(
      "{} of {} parts smoothed, {} refused: largest normal angle {:.3g} -> {:.3g} degrees", moved,
      smoothed.parts.size(), refused, smoothed.before_deg, smoothed.after_deg));
  return refused == 0;
}

}  // namespace

int run_smooth(const SmoothArguments& arguments) {
  const Console console;
  Stopwatch watch;
  const std::vector<std::filesystem::path> paths(arguments.outputs.begin(),
                                                 arguments.outputs.end());
  for (const auto& path : paths) {
    if (const auto target = check_export_target(path); !target) {
      return report_error(target.error());
    }
  }
  auto model = read_native(arguments.model, console.progress());
  if (!model) return report_error(model.error());
  watch.lap("read");
  SmoothNetworkOptions options;
  options.clean_deg = arguments.clean_deg;
  options.everything = arguments.everything;
  auto smoothed = smooth_network(model->network, options, console.progress());
  if (!smoothed) return report_error(smoothed.error());
  model->network = smoothed->network;
  watch.lap("smooth");
  const bool all = tell_parts(*smoothed, *model, console);
  const auto finished = finish_model(*model, paths, arguments.step_schema, console, watch);
  if (!finished) return report_error(finished.error());
  append_warnings(*model, finished->report);
  if (arguments.json) {
    Json json = model_json(*model);
    json["smoothing"] = smoothing_json(*smoothed);
    json["seconds"] = seconds_json(watch);
    json["files"] = arguments.outputs;
    json["check"] = to_json(finished->certificate);
    print_json(json);
  }
  const int outcome = tell_outcome(*model, finished->certificate, arguments.outputs, console);
  return all ? outcome : kFailure;
}

}  // namespace angiospline::cli
