#include "pipeline/smooth.h"

#include <utility>
#include <variant>

#include <fmt/format.h>

#include "pipeline/finish_model.h"

namespace angiospline {
namespace {

namespace fs = std::filesystem;

Result<Model> read_native(const fs::path& file, const Progress& progress) {
  auto any = read_any_model(file, progress);
  if (!any) return fail(any.error());
  if (auto* model = std::get_if<Model>(&*any)) return std::move(*model);
  return fail(
      {ErrorKind::kBadInput,
       "not a native model",
       file.string(),
       {},
       "only .json models know which patches belong together; write one with seed -o x.json"});
}

}  // namespace

Result<SmoothedFile> smooth_file(const fs::path& file, const std::vector<fs::path>& outputs,
                                 const SmoothFileOptions& options, const Progress& progress) {
  Stopwatch watch;
  if (auto targets = check_targets(outputs); !targets) return fail(targets.error());
  auto model = read_native(file, progress);
  if (!model) return fail(model.error());
  watch.lap("read");

  auto smoothed = smooth_network(std::move(model->network), options.smooth, progress);
  if (!smoothed) return fail(smoothed.error());
  model->network = std::move(smoothed->network);
  for (const SmoothedPart& part : smoothed->parts) {
    if (part.outcome != SmoothedPart::Outcome::kRefused) continue;
    model->warnings.push_back({WarningCode::kPartNotSmoothed,
                               fmt::format("{} could not be smoothed: {}", part.name, part.why)});
  }
  watch.lap("smooth");

  auto finished = finish_model(*std::move(model), outputs, options.writing, progress, watch);
  if (!finished) return fail(finished.error());
  SmoothedFile result{std::move(finished->model),
                      std::move(finished->certificate),
                      std::move(smoothed->parts),
                      smoothed->before_deg,
                      smoothed->after_deg,
                      {},
                      watch.laps()};
  for (const fs::path& path : outputs) result.files.push_back(path.string());
  return result;
}

}  // namespace angiospline
