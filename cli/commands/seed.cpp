#include <filesystem>
#include <optional>

#include <tbb/global_control.h>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/figures.h"
#include "cli/model_stages.h"
#include "io/centerlines/centerline_file.h"
#include "io/model/certificate_json.h"
#include "modeling/check/fidelity.h"

namespace angiospline::cli {

namespace {

// One output without a model's suffix, or with a folder of that name: a folder for many trees.
bool wants_batch(const SeedArguments& arguments) {
  if (arguments.outputs.size() != 1) return false;
  const std::filesystem::path target = arguments.outputs.front();
  return !target.has_extension() || std::filesystem::is_directory(target);
}

}  // namespace

int run_seed(const SeedArguments& arguments) {
  if (wants_batch(arguments)) return run_seed_batch(arguments);
  const Console console;
  std::optional<tbb::global_control> threads;
  if (arguments.threads > 0) {
    threads.emplace(tbb::global_control::max_allowed_parallelism,
                    static_cast<std::size_t>(arguments.threads));
  }
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
  const auto tree = read_centerline_files(
      std::vector<std::filesystem::path>(arguments.trees.begin(), arguments.trees.end()), *reading);
  if (!tree) return report_error(tree.error());
  watch.lap("read");

  BuildOptions options;
  options.extend_inlets = arguments.extend_inlets;
  options.extend_outlets = arguments.extend_outlets;
  options.clearance = arguments.clearance;
  auto smoothed = smooth_for_build(*tree, options, console.progress());
  if (!smoothed) return report_error(smoothed.error());
  watch.lap("smooth");
  auto seeded = build_with_room(*std::move(smoothed), options, console.progress());
  if (!seeded) return report_error(seeded.error());
  Model* const model = &seeded->model;
  model->name = arguments.name.empty()
                    ? std::filesystem::path(arguments.trees.front()).stem().string()
                    : arguments.name;
  watch.lap("model");
  Fidelity fidelity;
  const auto measure = [&] {
    fidelity = measure_fidelity(model->network, seeded->tree);
    watch.lap("fidelity");
  };
  const auto finished = finish_model(*model, paths, arguments.step_schema, console, watch, measure);
  if (!finished) return report_error(finished.error());
  append_warnings(*model, finished->report);
  if (arguments.json) {
    Json json = model_json(*model);
    json["seconds"] = seconds_json(watch);
    json["files"] = arguments.outputs;
    json["fidelity"] = fidelity_json(fidelity);
    json["check"] = to_json(finished->certificate);
    print_json(json);
  }
  console.say(to_text(fidelity));
  return tell_outcome(*model, finished->certificate, arguments.outputs, console);
}

}  // namespace angiospline::cli
