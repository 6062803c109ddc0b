#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>

#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/figures.h"
#include "cli/model_stages.h"
#include "io/certificate_json.h"
#include "io/glb_file.h"
#include "io/model_file.h"
#include "io/vtk_file.h"
#include "recovery/fit_model.h"
#include "recovery/metrics.h"
#include "recovery/voxelize.h"

namespace angiospline::cli {
namespace {

namespace fs = std::filesystem;

Result<MaskComparison> compare_with_truth(const Model& model, const ImageGrid& grid,
                                          const std::string& path, const Progress& progress) {
  const auto file = read_image(path, {}, progress);
  if (!file) return fail(file.error());
  const ImageGrid& own = grid_of(file->image);
  if (own.size != grid.size) {
    return fail({ErrorKind::kBadInput, "the truth is not of the image's size", path,
                 fmt::format("{} x {} x {} against {} x {} x {} voxels", own.size[0], own.size[1],
                             own.size[2], grid.size[0], grid.size[1], grid.size[2]),
                 "both lie on one grid"});
  }
  const auto truth = mask_from_image(file->image, path);
  if (!truth) return fail(truth.error());
  const auto mesh = tessellate(model.network, {}, progress);
  if (!mesh) return fail(mesh.error());
  return compare_masks(*truth, voxelized(mesh->mesh, truth->grid));
}

// The mean of |residual| over the points where it is known, and the file if one is wanted.
Result<double> tell_residual(const Model& model, const Image<float>& image,
                             const FitOptions& options, const std::string& path,
                             const Progress& progress) {
  const auto tessellation = tessellate(model.network, {}, progress);
  if (!tessellation) return fail(tessellation.error());
  const MeshField residual = wall_residual(model, *tessellation, image, options);
  double sum = 0, count = 0;
  for (const double r : residual.values) {
    if (std::isfinite(r)) sum += std::abs(r), count += 1;
  }
  if (!path.empty()) {
    const auto written = fs::path(path).extension() == ".glb"
                             ? write_glb(path, tessellation->mesh, {model.name, residual})
                             : write_vtk_mesh(path, tessellation->mesh, {residual});
    if (!written) return fail(written.error());
  }
  return count > 0 ? sum / count : 0.0;
}

Json fit_json(const FitReport& report, double mean_residual_mm) {
  Json held = Json::array();
  for (const HeldRegion& h : report.held) held.push_back({{"region", h.name}, {"why", h.why}});
  return {{"contrast", report.contrast},
          {"noise", report.noise},
          {"snr", report.snr},
          {"mesh_nodes", report.nodes},
          {"control_points", report.control_points},
          {"wave_factor", report.wave_factor},
          {"degrees_of_freedom", report.degrees_of_freedom},
          {"mean_axis_move_mm", report.mean_axis_move_mm},
          {"mean_move_mm", report.mean_move_mm},
          {"mean_residual_mm", mean_residual_mm},
          {"without_edge", report.without_edge},
          {"recaptured", report.recaptured},
          {"held", held}};
}

Json truth_json(const MaskComparison& c) {
  Json json = {{"missed_percent", c.missed_percent}, {"dice", c.dice}};
  if (c.surface) {
    json["mean_surface_distance_mm"] = c.surface->mean_mm;
    json["surface_distance_95_mm"] = c.surface->hausdorff95_mm;
  }
  return json;
}

}  // namespace

int run_fit(const FitArguments& arguments) {
  const Console console;
  Stopwatch watch;
  std::vector<fs::path> paths(arguments.outputs.begin(), arguments.outputs.end());
  for (const auto& path : paths) {
    if (const auto target = check_export_target(path); !target) {
      return report_error(target.error());
    }
  }
  const fs::path residual_suffix = fs::path(arguments.residual).extension();
  if (!arguments.residual.empty() && residual_suffix != ".glb" && residual_suffix != ".vtp") {
    return report_error({ErrorKind::kCannotWrite, "residuals cannot be written to this file",
                         arguments.residual, residual_suffix.string(), ".glb or .vtp"});
  }
  if (fs::path(arguments.model).extension() != ".json") {
    return report_error({ErrorKind::kBadInput, "only a native model can be fitted", arguments.model,
                         fs::path(arguments.model).extension().string(),
                         "a .json that seed, recover or fit wrote"});
  }
  const auto model = read_model(arguments.model);
  if (!model) return report_error(model.error());
  const auto file = read_image(arguments.image, {}, console.progress());
  if (!file) return report_error(file.error());
  const auto image = grey_image(file->image, arguments.image);
  if (!image) return report_error(image.error());
  watch.lap("read");

  FitOptions options;
  options.dark = arguments.dark;
  options.capture = arguments.capture;
  const auto fitted = fit_model(*model, *image, options, console.progress());
  if (!fitted) {
    Error error = fitted.error();
    if (error.where == "fit") error.where = arguments.model + " in " + arguments.image;
    return report_error(error);
  }
  watch.lap("fit");
  std::optional<MaskComparison> truth;
  if (!arguments.truth.empty()) {
    auto compared =
        compare_with_truth(fitted->model, image->grid, arguments.truth, console.progress());
    if (!compared) return report_error(compared.error());
    truth = *compared;
    watch.lap("truth");
  }
  const auto residual =
      tell_residual(fitted->model, *image, options, arguments.residual, console.progress());
  if (!residual) return report_error(residual.error());
  watch.lap("residual");
  const auto certificate =
      finish_model(fitted->model, paths, arguments.step_schema, console, watch);
  if (!certificate) return report_error(certificate.error());

  const FitReport& report = fitted->report;
  console.say(fmt::format(
      "SNR {:.3g}; axes moved {:.3g} mm, walls {:.3g} mm; {:.3g} mm left; {} control points",
      report.snr, report.mean_axis_move_mm, report.mean_move_mm, *residual, report.control_points));
  if (truth) {
    console.say(fmt::format(
        "truth: {:.3g} % missed, Dice {:.4f}, surface distance {:.3g} mm (mean), {:.3g} mm (95 %)",
        truth->missed_percent, truth->dice, truth->surface ? truth->surface->mean_mm : 0.0,
        truth->surface ? truth->surface->hausdorff95_mm : 0.0));
  }
  std::vector<std::string> files = arguments.outputs;
  if (!arguments.residual.empty()) files.push_back(arguments.residual);
  if (arguments.json) {
    Json json = model_json(fitted->model);
    json["fit"] = fit_json(report, *residual);
    if (truth) json["truth"] = truth_json(*truth);
    json["seconds"] = seconds_json(watch);
    json["files"] = files;
    json["check"] = to_json(*certificate);
    print_json(json);
  }
  return tell_outcome(fitted->model, *certificate, files, console);
}

}  // namespace angiospline::cli
