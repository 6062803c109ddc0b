#include "pipeline/build.h"

#include <cstddef>
#include <optional>
#include <utility>

#include <tbb/global_control.h>

#include "base/contract.h"
#include "pipeline/finish_model.h"

namespace angiospline {

Result<BuiltFile> build_file(const std::vector<std::filesystem::path>& tree_files,
                             const std::vector<std::filesystem::path>& outputs,
                             const BuildFileOptions& options, const Progress& progress) {
  EXPECTS(!tree_files.empty());
  std::optional<tbb::global_control> threads;
  if (options.threads > 0) {
    threads.emplace(tbb::global_control::max_allowed_parallelism,
                    static_cast<std::size_t>(options.threads));
  }

  Stopwatch watch;
  if (auto targets = check_targets(outputs); !targets) return fail(targets.error());
  const auto tree = read_centerline_files(tree_files, options.reading);
  if (!tree) return fail(tree.error());
  watch.lap("read");

  auto smoothed = smooth_for_build(*tree, options.build, progress);
  if (!smoothed) return fail(smoothed.error());
  watch.lap("smooth");
  auto built = build_with_room(*std::move(smoothed), options.build, progress);
  if (!built) return fail(built.error());
  built->model.name = options.name.empty() ? tree_files.front().stem().string() : options.name;
  watch.lap("model");

  // Fidelity is measured while a STEP file may still be under way.
  BuiltFile result;
  const auto measure = [&](const Model& model) {
    result.fidelity = measure_fidelity(model.network, built->tree);
    watch.lap("fidelity");
  };
  auto finished =
      finish_model(std::move(built->model), outputs, options.writing, progress, watch, measure);
  if (!finished) return fail(finished.error());
  result.model = std::move(finished->model);
  result.certificate = std::move(finished->certificate);
  for (const std::filesystem::path& path : outputs) result.files.push_back(path.string());
  result.seconds = watch.laps();
  return result;
}

}  // namespace angiospline
