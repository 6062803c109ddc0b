#include <filesystem>

#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/figures.h"
#include "cli/model_stages.h"
#include "io/centerline_file.h"
#include "io/certificate_json.h"

namespace angiospline::cli {

int run_seed(const SeedArguments& arguments) {
  const Console console;
  Stopwatch watch;
  const std::vector<std::filesystem::path> paths(arguments.outputs.begin(),
                                                 arguments.outputs.end());
  for (const auto& path : paths) {
    if (const auto target = check_export_target(path); !target) {
      return report_error(target.error());
    }
  }
  const auto reading = centerline_options(arguments.reading);
  if (!reading) return report_error(reading.error());
  const auto tree = read_centerline_file(arguments.tree, *reading);
  if (!tree) return report_error(tree.error());
  watch.lap("read");

  auto model = seed_model(*tree, {}, console.progress());
  if (!model) return report_error(model.error());
  model->name = arguments.name.empty() ? std::filesystem::path(arguments.tree).stem().string()
                                       : arguments.name;
  watch.lap("model");
  const auto finished = finish_model(*model, paths, arguments.step_schema, console, watch);
  if (!finished) return report_error(finished.error());
  if (arguments.json) {
    Json json = model_json(*model);
    json["seconds"] = seconds_json(watch);
    json["files"] = arguments.outputs;
    json["check"] = to_json(*finished);
    print_json(json);
  }
  return tell_outcome(*model, *finished, arguments.outputs, console);
}

}  // namespace angiospline::cli
