#include "cli/model_stages.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "modeling/solid/solid.h"

namespace angiospline::cli {

Result<CenterlineFileOptions> centerline_options(const CenterlineArguments& arguments) {
  CenterlineFileOptions options;
  if (!arguments.unit.empty()) {
    const auto unit = parse_unit_mm(arguments.unit);
    if (!unit) return fail(unit.error());
    options.unit_mm = *unit;
  }
  options.radius_is_diameter = arguments.radius_is_diameter;
  options.voxel_width = arguments.voxel_width;
  if (arguments.frame == "LPS") options.frame = CoordinateFrame::kLps;
  if (arguments.frame == "RAS") options.frame = CoordinateFrame::kRas;
  return options;
}

StepSchema step_schema(const std::string& name) {
  return name == "AP214" ? StepSchema::kAp214 : StepSchema::kAp242;
}

Result<FinishedModel> finish_model(const Model& model,
                                   const std::vector<std::filesystem::path>& paths,
                                   const std::string& schema, const Console& console,
                                   Stopwatch& watch, const std::function<void()>& meanwhile) {
  ExportOptions options;
  options.step_in_side_process = true;
  options.step_schema = step_schema(schema);
  std::optional<Result<Certificate>> certificate;
  const auto check = [&] {
    watch.lap("write");
    const auto solid = make_solid(model.network);
    certificate =
        solid ? certify(*solid, {}, console.progress()) : Result<Certificate>(fail(solid.error()));
    watch.lap("check");
    if (meanwhile) meanwhile();
  };
  auto written = export_model(model, paths, options, console.progress(), check);
  watch.lap("wait for files");
  if (!written) return fail(written.error());
  if (!*certificate) return fail(certificate->error());
  return FinishedModel{**std::move(certificate), *std::move(written)};
}

void append_warnings(Model& model, const ExportReport& report) {
  model.warnings.insert(model.warnings.end(), report.warnings.begin(), report.warnings.end());
}

int tell_outcome(const Model& model, const Certificate& certificate,
                 const std::vector<std::string>& files, const Console& console) {
  for (const std::string& text : model.assumptions) console.say("note: " + text);
  for (const Warning& warning : model.warnings) console.warn(warning);
  for (const FailedPart& part : model.failed) {
    console.say(fmt::format("failed: {}: {}", part.name, part.why));
  }
  const bool sound = certificate.closed && certificate.valid && !certificate.self_intersecting;
  console.say(
      fmt::format("{} branches, {} patches, {} solid{}: {:.6g} mm3, {}, largest normal angle "
                  "{:.2g} degrees -> {}",
                  model.tree.branches.size(), model.network.patches.size(), certificate.solids,
                  certificate.solids == 1 ? "" : "s", certificate.volume_mm3,
                  sound                           ? "closed and valid"
                  : certificate.self_intersecting ? "self-intersecting"
                  : certificate.closed            ? "closed but not valid"
                                                  : "not closed",
                  certificate.max_normal_angle_deg, fmt::join(files, " ")));
  return model.failed.empty() && sound ? kSuccess : kFailure;
}

}  // namespace angiospline::cli
