#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>

#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/figures.h"
#include "cli/model_stages.h"
#include "cli/stages.h"
#include "io/meshes/glb_file.h"
#include "io/meshes/vtk_file.h"
#include "io/model/certificate_json.h"
#include "io/model/model_file.h"
#include "recovery/analysis/compare_masks.h"
#include "recovery/fit/closed_surface.h"
#include "recovery/fit/figures.h"
#include "recovery/fit/fit_model.h"
#include "recovery/imaging/rasterize/voxelize.h"
#include "recovery/thesis/deform/deform_model.h"

namespace angiospline::cli {
namespace {

namespace fs = std::filesystem;

// The mask to measure by: on the image's own grid, which is checked before anything long begins.
Result<Mask> read_truth(const std::string& path, const ImageGrid& grid, const Progress& progress) {
  const auto file = read_image(path, {}, progress);
  if (!file) return fail(file.error());
  const ImageGrid& own = grid_of(file->image);
  if (own.size != grid.size) {
    return fail({ErrorKind::kBadInput, "the truth is not of the image's size", path,
                 fmt::format("{} x {} x {} against {} x {} x {} voxels", own.size[0], own.size[1],
                             own.size[2], grid.size[0], grid.size[1], grid.size[2]),
                 "both lie on one grid"});
  }
  constexpr double kOff = 0.01;  // voxels between far corners
  const Vec3 corner(grid.size[0] - 1, grid.size[1] - 1, grid.size[2] - 1);
  for (const Vec3& at : {Vec3(0, 0, 0), corner}) {
    const Vec3 mm = own.world_mm(at);
    if ((grid.index_vox(mm) - at).norm() <= kOff) continue;
    const Vec3 image_mm = grid.world_mm(at);
    return fail({ErrorKind::kBadInput, "the truth does not lie where the image does", path,
                 fmt::format("voxel ({}, {}, {}) is at ({:.5g}, {:.5g}, {:.5g}) mm, the image's at "
                             "({:.5g}, {:.5g}, {:.5g})",
                             at(0), at(1), at(2), mm(0), mm(1), mm(2), image_mm(0), image_mm(1),
                             image_mm(2)),
                 "both lie on one grid"});
  }
  return mask_from_image(file->image, path);
}

Result<MaskComparison> compare_with_truth(const Model& model, const Mask& truth,
                                          const Progress& progress) {
  const auto mesh = tessellate(model.network, {}, progress);
  if (!mesh) return fail(mesh.error());
  return compare_masks(truth, voxelized(mesh->mesh, truth.grid));
}

Result<void> write_residual(const std::string& path, const std::string& name,
                            const TriangleMesh& mesh, const MeshField& residual) {
  if (path.empty()) return {};
  return fs::path(path).extension() == ".glb" ? write_glb(path, mesh, {name, residual})
                                              : write_vtk_mesh(path, mesh, {residual});
}

// A model, and what its fit has to say.
struct Fitted {
  Model model;
  std::vector<PartFigures> parts;  // the last one: all
  bool converged = false;
  int iterations = 0;
  const char* force_unit = "mm";
  Json details;                // of the way it was fitted
  std::string summary;         // for people
  TriangleMesh residual_mesh;  // what is left of the distance, or of the force, on it
  MeshField residual;
  std::vector<std::string> unconverged;  // parts that were held or have no wall near them

  bool converged_part(const std::string& name) const {
    const bool named = std::find(unconverged.begin(), unconverged.end(), name) != unconverged.end();
    return !named && (converged || !unconverged.empty());
  }
};

Json report_json(const FitReport& report) {
  Json held = Json::array();
  for (const HeldRegion& h : report.held) held.push_back({{"region", h.name}, {"why", h.why}});
  return {{"method", "wall"},
          {"contrast", report.contrast},
          {"noise", report.noise},
          {"noise_kind", report.noise_kind == NoiseKind::kRician ? "rician" : "white"},
          {"snr", report.snr},
          {"mesh_nodes", report.nodes},
          {"control_points", report.control_points},
          {"control_points_before_reduction", report.control_points_before_reduction},
          {"reduction_mm", report.reduction_mm},
          {"wave_factor", report.wave_factor},
          {"degrees_of_freedom", report.degrees_of_freedom},
          {"mean_axis_move_mm", report.mean_axis_move_mm},
          {"mean_move_mm", report.mean_move_mm},
          {"without_edge", report.without_edge},
          {"recaptured", report.recaptured},
          {"refined", report.refined},
          {"held", held}};
}

// The default fit; what the image still asks for is its residual.
Result<Fitted> fit_walls(const Model& model, const Image<float>& image,
                         const FitArguments& arguments, const Progress& progress) {
  constexpr double kConverged = 0.1;  // voxels that the image still asks for, in the mean
  FitOptions options;
  options.dark = arguments.dark;
  options.capture = arguments.capture;
  options.refinements = arguments.refinements;
  auto fitted = fit_model(model, image, options, progress);
  if (!fitted) return fail(fitted.error());
  const auto before = tessellate(model.network, {}, progress);
  if (!before) return fail(before.error());
  auto mesh = tessellate(fitted->model.network, {}, progress);
  if (!mesh) return fail(mesh.error());
  MeshField residual = wall_residual(fitted->model, *mesh, image, options, progress);
  if (progress.should_stop()) return fail(cancelled("wall"));
  const FitReport& report = fitted->report;
  Fitted result;
  result.parts = part_figures(mesh->mesh, residual, before->mesh);
  const double left = result.parts.back().residual_mean;
  result.converged = left < kConverged * std::cbrt(image.grid.spacing_mm.prod()) &&
                     report.held.empty() && report.without_edge.empty();
  for (const HeldRegion& h : report.held) result.unconverged.push_back(h.name);
  for (const std::string& name : report.without_edge) result.unconverged.push_back(name);
  result.iterations = report.iterations;
  result.details = report_json(report);
  result.details["mean_residual_mm"] = left;
  result.summary = fmt::format(
      "{} noise, SNR {:.3g}; axes moved {:.3g} mm, walls {:.3g} mm; {:.3g} mm left; {} control "
      "points "
      "({} before data reduction)",
      report.noise_kind == NoiseKind::kRician ? "Rician" : "white", report.snr,
      report.mean_axis_move_mm, report.mean_move_mm, left, report.control_points,
      report.control_points_before_reduction);
  result.residual_mesh = std::move(mesh->mesh);
  result.residual = std::move(residual);
  result.model = std::move(fitted->model);
  return result;
}

// The thesis's way; residual forces are in the potential's unit.
Result<Fitted> fit_by_edges(const Model& model, const Image<float>& image,
                            const FitArguments& arguments, const Progress& progress) {
  DeformModelOptions options;
  options.method = *deform_method(arguments.solver);
  options.potential =
      arguments.potential == "spring" ? PotentialKind::kSpring : PotentialKind::kGravity;
  options.strength = arguments.strength;
  options.reach_vox = arguments.reach_vox;
  options.stiffness = arguments.stiffness;
  options.edge_percentile = arguments.edge_percentile;
  options.most_iterations = arguments.most_iterations;
  options.dark = arguments.dark;
  auto deformed = deform_model(model, image, options, progress);
  if (!deformed) return fail(deformed.error());
  Fitted result;
  result.parts = deformed->parts;
  result.converged =
      deformed->report.termination == Termination::kAtRest && deformed->without_edge.empty();
  result.unconverged = deformed->without_edge;
  result.iterations = deformed->report.iterations;
  result.force_unit = "potential";
  result.details = {{"method", arguments.solver},
                    {"potential", arguments.potential},
                    {"strength", arguments.strength},
                    {"termination", std::string(to_string(deformed->report.termination))},
                    {"mesh_nodes", deformed->nodes},
                    {"edges", deformed->edges},
                    {"control_points", deformed->model.network.control_points_mm.cols()},
                    {"without_edge", deformed->without_edge},
                    {"coarsening_mm", deformed->coarsening_mm},
                    {"angle_before_deg", deformed->angle_before_deg},
                    {"angle_after_deg", deformed->angle_after_deg}};
  result.summary =
      fmt::format("{}: {} after {} iterations; {} nodes among {} edges, moved {:.3g} mm",
                  arguments.solver, to_string(deformed->report.termination), result.iterations,
                  deformed->nodes, deformed->edges, result.parts.back().moved_mean_mm);
  result.residual_mesh = std::move(deformed->mesh);
  result.residual = std::move(deformed->residual_force);
  result.model = std::move(deformed->model);
  return result;
}

Json figures_json(const PartFigures& p, const char* unit) {
  return {{"name", p.name},
          {"residual_force", {{"mean", p.residual_mean}, {"max", p.residual_most}, {"unit", unit}}},
          {"moved_mm", {{"mean", p.moved_mean_mm}, {"max", p.moved_most_mm}}}};
}

void add_truth(Json& json, const MaskComparison& c) {
  json["truth_voxels"] = c.truth_voxels;
  json["missed_voxels"] = c.missed + c.beyond;
  json["missed_percent"] = c.missed_percent;
  json["dice"] = c.dice;
  if (c.surface) {
    json["assd_mm"] = c.surface->mean_mm;
    json["hausdorff95_mm"] = c.surface->hausdorff95_mm;
  }
}

bool is_model_file(const std::string& path) { return fs::path(path).extension() == ".json"; }

// The start: a native model, or closed surfaces around the pieces of a mask.
Result<Model> start_of(const std::string& path, const Progress& progress) {
  if (is_model_file(path)) return read_model(path);
  const auto file = read_image(path, {}, progress);
  if (!file) {
    return fail({ErrorKind::kBadInput, "only a native model or a mask can be fitted", path,
                 fs::path(path).extension().string(),
                 "a .json that seed, recover or fit wrote, or an image that is not zero inside"});
  }
  return mask_from_image(file->image, path).and_then([&](const Mask& mask) {
    auto model = closed_model(mask);
    if (!model && model.error().where.empty()) {
      Error error = model.error();
      error.where = path;
      return Result<Model>(fail(error));
    }
    if (model) model->name = fs::path(path).stem().string();
    return model;
  });
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
  const auto model = start_of(arguments.model, console.progress());
  if (!model) return report_error(model.error());
  const auto file = read_image(arguments.image, {}, console.progress());
  if (!file) return report_error(file.error());
  const auto image = grey_image(file->image, arguments.image);
  if (!image) return report_error(image.error());
  std::optional<Mask> truth_mask;
  if (!arguments.truth.empty()) {
    auto truth = read_truth(arguments.truth, image->grid, console.progress());
    if (!truth) return report_error(truth.error());
    truth_mask = *std::move(truth);
  }
  watch.lap("read");

  auto fitted = arguments.solver.empty()
                    ? fit_walls(*model, *image, arguments, console.progress())
                    : fit_by_edges(*model, *image, arguments, console.progress());
  if (!fitted) {
    Error error = fitted.error();
    if (error.where == "fit") error.where = arguments.model + " in " + arguments.image;
    return report_error(error);
  }
  watch.lap("fit");
  std::optional<MaskComparison> truth;
  if (truth_mask) {
    const auto compared = compare_with_truth(fitted->model, *truth_mask, console.progress());
    if (!compared) return report_error(compared.error());
    truth = *compared;
    watch.lap("truth");
  }
  const auto finished = finish_model(fitted->model, paths, arguments.step_schema, console, watch);
  if (!finished) return report_error(finished.error());
  append_warnings(fitted->model, finished->report);
  if (const auto written = write_residual(arguments.residual, fitted->model.name,
                                          fitted->residual_mesh, fitted->residual);
      !written) {
    return report_error(written.error());
  }

  console.say(fitted->summary);
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
    json["iterations"] = fitted->iterations;
    json["converged"] = fitted->converged;
    const Json all = figures_json(fitted->parts.back(), fitted->force_unit);
    json["residual_force"] = all["residual_force"];
    json["moved_mm"] = all["moved_mm"];
    json["parts"] = Json::array();
    for (std::size_t p = 0; p + 1 < fitted->parts.size(); ++p) {
      Json part = figures_json(fitted->parts[p], fitted->force_unit);
      part["iterations"] = fitted->iterations;
      part["converged"] = fitted->converged_part(fitted->parts[p].name);
      json["parts"].push_back(part);
    }
    json["fit"] = fitted->details;
    if (truth) add_truth(json, *truth);
    json["seconds"] = seconds_json(watch);
    json["files"] = files;
    json["check"] = to_json(finished->certificate);
    print_json(json);
  }
  return tell_outcome(fitted->model, finished->certificate, files, console);
}

}  // namespace angiospline::cli
