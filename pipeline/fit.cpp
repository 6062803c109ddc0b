#include "pipeline/fit.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "io/images/image_file.h"
#include "io/meshes/glb_file.h"
#include "io/meshes/vtk_file.h"
#include "io/model/model_file.h"
#include "modeling/network/tessellation.h"
#include "pipeline/finish_model.h"
#include "recovery/fit/closed_surface.h"
#include "recovery/imaging/rasterize/voxelize.h"
#include "recovery/imaging/segment/label_map.h"

namespace angiospline {
namespace {

namespace fs = std::filesystem;

constexpr double kConverged = 0.1;     // voxels that the image still asks for, in the mean
constexpr double kOffGrid_vox = 0.01;  // between the far corners of two images on one grid

// The mask to measure by: on the image's own grid, which is checked before anything long begins.
Result<Mask> read_truth(const fs::path& path, const ImageGrid& grid, const Progress& progress) {
  const auto file = read_image(path, {}, progress);
  if (!file) return fail(file.error());
  const ImageGrid& own = grid_of(file->image);
  if (own.size != grid.size) {
    return fail({ErrorKind::kBadInput, "the truth is not of the image's size", path.string(),
                 fmt::format("{} x {} x {} against {} x {} x {} voxels", own.size[0], own.size[1],
                             own.size[2], grid.size[0], grid.size[1], grid.size[2]),
                 "both lie on one grid"});
  }

  // Two grids of one size are the same if their opposite corners are.
  const Vec3 corner(grid.size[0] - 1, grid.size[1] - 1, grid.size[2] - 1);
  for (const Vec3& at : {Vec3(0, 0, 0), corner}) {
    const Vec3 mm = own.world_mm(at);
    if ((grid.index_vox(mm) - at).norm() <= kOffGrid_vox) continue;
    const Vec3 image_mm = grid.world_mm(at);
    return fail({ErrorKind::kBadInput, "the truth does not lie where the image does", path.string(),
                 fmt::format("voxel ({}, {}, {}) is at ({:.5g}, {:.5g}, {:.5g}) mm, the image's at "
                             "({:.5g}, {:.5g}, {:.5g})",
                             at(0), at(1), at(2), mm(0), mm(1), mm(2), image_mm(0), image_mm(1),
                             image_mm(2)),
                 "both lie on one grid"});
  }
  return mask_from_image(file->image, path.string());
}

Result<MaskComparison> compare_with_truth(const Model& model, const Mask& truth,
                                          const Progress& progress) {
  const auto mesh = tessellate(model.network, {}, progress);
  if (!mesh) return fail(mesh.error());
  return compare_masks(truth, voxelized(mesh->mesh, truth.grid));
}

Result<void> check_residual_target(const fs::path& path) {
  const std::string suffix = path.extension().string();
  if (path.empty() || suffix == ".glb" || suffix == ".vtp") return {};
  return fail({ErrorKind::kCannotWrite, "residuals cannot be written to this file", path.string(),
               suffix, ".glb or .vtp"});
}

Result<void> write_residual(const fs::path& path, const std::string& name, const TriangleMesh& mesh,
                            const MeshField& residual) {
  if (path.empty()) return {};
  return path.extension() == ".glb" ? write_glb(path, mesh, {name, residual})
                                    : write_vtk_mesh(path, mesh, {residual});
}

// A fit before its files, and what is left of the distance, or of the force, on a mesh.
struct Fitted {
  FittedFile file;
  TriangleMesh residual_mesh;
  MeshField residual;
};

// The default fit; what the image still asks for is its residual.
Result<Fitted> fit_walls(const Model& model, const Image<float>& image, const FitOptions& options,
                         const Progress& progress) {
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
  FittedFile& file = result.file;
  file.parts = part_figures(mesh->mesh, residual, before->mesh);
  const double left = file.parts.back().residual_mean;
  file.converged = left < kConverged * std::cbrt(image.grid.spacing_mm.prod()) &&
                   report.held.empty() && report.without_edge.empty();
  for (const HeldRegion& h : report.held) file.unconverged.push_back(h.name);
  for (const std::string& name : report.without_edge) file.unconverged.push_back(name);
  file.iterations = report.iterations;
  file.wall = WallFit{report, left};
  file.model = std::move(fitted->model);
  result.residual_mesh = std::move(mesh->mesh);
  result.residual = std::move(residual);
  return result;
}

// The thesis's way; residual forces are in the potential's unit.
Result<Fitted> fit_by_edges(const Model& model, const Image<float>& image,
                            const DeformModelOptions& options, const Progress& progress) {
  auto deformed = deform_model(model, image, options, progress);
  if (!deformed) return fail(deformed.error());

  Fitted result;
  FittedFile& file = result.file;
  file.converged =
      deformed->report.termination == Termination::kAtRest && deformed->without_edge.empty();
  file.iterations = deformed->report.iterations;
  file.edges = EdgeFit{options,
                       deformed->report,
                       deformed->nodes,
                       deformed->edges,
                       deformed->model.network.control_points_mm.cols(),
                       deformed->coarsening_mm,
                       deformed->angle_before_deg,
                       deformed->angle_after_deg};
  file.parts = std::move(deformed->parts);
  file.unconverged = std::move(deformed->without_edge);
  file.model = std::move(deformed->model);
  result.residual_mesh = std::move(deformed->mesh);
  result.residual = std::move(deformed->residual_force);
  return result;
}

// The start: a native model, or closed surfaces around the pieces of a mask.
Result<Model> start_of(const fs::path& path, const Progress& progress) {
  if (path.extension() == ".json") return read_model(path);
  const auto file = read_image(path, {}, progress);
  if (!file) {
    return fail({ErrorKind::kBadInput, "only a native model or a mask can be fitted", path.string(),
                 path.extension().string(),
                 "a .json that seed, recover or fit wrote, or an image that is not zero inside"});
  }
  const auto mask = mask_from_image(file->image, path.string());
  if (!mask) return fail(mask.error());
  auto model = closed_model(*mask);
  if (!model) {
    Error error = model.error();
    if (error.where.empty()) error.where = path.string();
    return fail(std::move(error));
  }
  model->name = path.stem().string();
  return model;
}

// Everything that is read.
struct Inputs {
  Model model;
  Image<float> image;
  std::optional<Mask> truth;
};

Result<Inputs> read_inputs(const fs::path& start, const fs::path& image_path,
                           const fs::path& truth_path, const Progress& progress) {
  auto model = start_of(start, progress);
  if (!model) return fail(model.error());
  const auto file = read_image(image_path, {}, progress);
  if (!file) return fail(file.error());
  auto image = grey_image(file->image, image_path.string());
  if (!image) return fail(image.error());
  Inputs inputs{*std::move(model), *std::move(image), std::nullopt};
  if (truth_path.empty()) return inputs;
  auto truth = read_truth(truth_path, inputs.image.grid, progress);
  if (!truth) return fail(truth.error());
  inputs.truth = *std::move(truth);
  return inputs;
}

}  // namespace

bool converged_part(const FittedFile& fitted, const std::string& name) {
  const auto& left = fitted.unconverged;
  const bool named = std::find(left.begin(), left.end(), name) != left.end();
  return !named && (fitted.converged || !left.empty());
}

Result<FittedFile> fit_file(const fs::path& start, const fs::path& image,
                            const std::vector<fs::path>& outputs, const FitFileOptions& options,
                            const Progress& progress) {
  Stopwatch watch;
  if (auto targets = check_targets(outputs); !targets) return fail(targets.error());
  if (auto target = check_residual_target(options.residual); !target) return fail(target.error());
  const auto inputs = read_inputs(start, image, options.truth, progress);
  if (!inputs) return fail(inputs.error());
  watch.lap("read");

  auto fitted = options.deform
                    ? fit_by_edges(inputs->model, inputs->image, *options.deform, progress)
                    : fit_walls(inputs->model, inputs->image, options.fit, progress);
  if (!fitted) {
    Error error = fitted.error();
    if (error.where == "fit") error.where = start.string() + " in " + image.string();
    return fail(std::move(error));
  }
  watch.lap("fit");

  FittedFile result = std::move(fitted->file);
  if (inputs->truth) {
    auto compared = compare_with_truth(result.model, *inputs->truth, progress);
    if (!compared) return fail(compared.error());
    result.truth = *std::move(compared);
    watch.lap("truth");
  }

  auto finished = finish_model(std::move(result.model), outputs, options.writing, progress, watch);
  if (!finished) return fail(finished.error());
  result.model = std::move(finished->model);
  result.certificate = std::move(finished->certificate);
  if (auto written = write_residual(options.residual, result.model.name, fitted->residual_mesh,
                                    fitted->residual);
      !written) {
    return fail(written.error());
  }
  for (const fs::path& path : outputs) result.files.push_back(path.string());
  if (!options.residual.empty()) result.files.push_back(options.residual.string());
  result.seconds = watch.laps();
  return result;
}

}  // namespace angiospline
