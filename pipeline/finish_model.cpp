#include "pipeline/finish_model.h"

#include <optional>
#include <utility>

#include "modeling/solid/solid.h"

namespace angiospline {

Result<void> check_targets(const std::vector<std::filesystem::path>& paths) {
  for (const std::filesystem::path& path : paths) {
    if (auto target = check_export_target(path); !target) return target;
  }
  return {};
}

Result<FinishedModel> finish_model(Model model, const std::vector<std::filesystem::path>& paths,
                                   const ExportOptions& options, const Progress& progress,
                                   Stopwatch& watch,
                                   const std::function<void(const Model&)>& meanwhile) {
  // The certificate is of the network as it is. Files hold other solids of the same shape, with
  // patches turned and reordered and edges cut, and STEP makes its own in another process: none of
  // them can be lent, for sums over faces in another order round otherwise.
  std::optional<Result<Certificate>> certificate;
  const auto check = [&] {
    watch.lap("write");
    const auto solid = make_solid(model.network);
    certificate = solid ? certify(*solid, {}, progress) : Result<Certificate>(fail(solid.error()));
    watch.lap("check");
    if (meanwhile) meanwhile(model);
  };

  auto written = export_model(model, paths, options, progress, check);
  watch.lap("wait for files");
  if (!written) return fail(written.error());
  if (!*certificate) return fail(certificate->error());

  model.warnings.insert(model.warnings.end(), written->warnings.begin(), written->warnings.end());
  return FinishedModel{std::move(model), **std::move(certificate)};
}

bool is_sound(const Certificate& certificate) {
  return certificate.closed && certificate.valid && !certificate.self_intersecting;
}

}  // namespace angiospline
