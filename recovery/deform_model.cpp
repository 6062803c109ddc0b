#include "recovery/deform_model.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "recovery/fit_model.h"

namespace angiospline {
namespace {

std::size_t at(Eigen::Index i) { return static_cast<std::size_t>(i); }

// Rims' rows back into their planes; centres and radii anew.
void flatten_rims(SurfaceNetwork& network) {
  for (Rim& rim : network.rims) {
    Vec3 center = Vec3::Zero();
    double count = 0;
    std::vector<int> columns;
    for (const Side& side : rim.sides) {
      const Patch& patch = network.patches[at(side.patch)];
      const int nu = patch.u.control_point_count(), nv = patch.v.control_point_count();
      const bool along_v = side.side == PatchSide::kU0 || side.side == PatchSide::kU1;
      for (int k = 0; k < (along_v ? nv : nu); ++k) {
        const int i = along_v ? (side.side == PatchSide::kU0 ? 0 : nu - 1) : k;
        const int j = along_v ? k : (side.side == PatchSide::kV0 ? 0 : nv - 1);
        columns.push_back(patch.control[at(i * nv + j)]);
      }
    }
    for (const int c : columns) {
      Vec3 p = network.control_points_mm.col(c);
      p -= rim.normal.dot(p - rim.center_mm) * rim.normal;
      network.control_points_mm.col(c) = p;
      center += p;
      count += 1;
    }
    rim.center_mm = center / count;
    double radius = 0;
    for (const int c : columns) {
      radius += (network.control_points_mm.col(c) - rim.center_mm).norm() / count;
    }
    rim.radius_mm = radius;
  }
}

// The point of the surface that each pool column stands for: at its Greville parameters. Control
// points themselves stand off a curved wall, by more than edges are wrong.
Points3 points_of_columns(const SurfaceNetwork& network) {
  Points3 points = network.control_points_mm;
  for (std::size_t p = 0; p < network.patches.size(); ++p) {
    const Patch& patch = network.patches[p];
    const BSplineSurface<3> surface = patch_surface(network, static_cast<int>(p));
    const std::vector<double> us = patch.u.greville(), vs = patch.v.greville();
    for (std::size_t i = 0; i < us.size(); ++i) {
      for (std::size_t j = 0; j < vs.size(); ++j) {
        points.col(patch.control[i * vs.size() + j]) = surface.at(us[i], vs[j]);
      }
    }
  }
  return points;
}

// Pool columns of the refined network are the mesh's nodes.
std::vector<PartFigures> figures_of_parts(const SurfaceNetwork& fine, const Points3& moves,
                                          const Eigen::VectorXd& forces) {
  std::vector<std::vector<char>> of_region(fine.regions.size() + 1,
                                           std::vector<char>(at(moves.cols()), 0));
  for (const Patch& patch : fine.patches) {
    for (const int c : patch.control) of_region[at(patch.region)][at(c)] = 1;
  }
  of_region.back().assign(at(moves.cols()), 1);
  std::vector<PartFigures> parts;
  for (std::size_t r = 0; r < of_region.size(); ++r) {
    PartFigures part;
    part.name = r < fine.regions.size() ? fine.regions[r].name : "all";
    double count = 0;
    for (Eigen::Index k = 0; k < moves.cols(); ++k) {
      if (!of_region[r][at(k)]) continue;
      const double moved = moves.col(k).norm();
      part.residual_mean += forces(k);
      part.residual_most = std::max(part.residual_most, forces(k));
      part.moved_mean_mm += moved;
      part.moved_most_mm = std::max(part.moved_most_mm, moved);
      count += 1;
    }
    if (count > 0) part.residual_mean /= count, part.moved_mean_mm /= count;
    parts.push_back(part);
  }
  return parts;
}

}  // namespace

Result<DeformedModel> deform_model(const Model& model, const Image<float>& image,
                                   const DeformModelOptions& options, const Progress& progress) {
  if (auto apart = frames_apart(model.network.control_points_mm, image.grid)) return fail(*apart);
  const auto field = find_edges(image, {EdgePercentile{options.edge_percentile}}, progress);
  if (!field) return fail(field.error());
  NetworkMeshOptions fineness;
  fineness.least_pieces = options.pieces;
  auto fine = refine_network(model.network, fineness);
  if (!fine) return fail(fine.error());
  DeformMesh start = control_mesh(fine->network);
  start.nodes_mm = points_of_columns(fine->network);
  const double voxel = std::cbrt(image.grid.spacing_mm.prod());
  DeformOptions how =
      steady_options(options.method, start, options.potential, options.strength, options.reach_vox);
  how.most_iterations = options.most_iterations;
  how.potential.bright_inside = !options.dark;
  if (options.stiffness) how.elements.spring = *options.stiffness;
  auto deformed = deform(start, edge_points(*field, image.grid), voxel, how, progress);
  if (!deformed) return fail(deformed.error());

  DeformedModel result;
  result.nodes = start.node_count();
  result.edges = static_cast<int>(field->edges.size());
  result.mesh = triangles_of(deformed->mesh, Caps::kFans);
  result.residual_force = residual_field(deformed->report, result.mesh);
  result.parts = figures_of_parts(fine->network, deformed->mesh.nodes_mm - start.nodes_mm,
                                  deformed->report.residual_force);
  fine->network.control_points_mm += deformed->mesh.nodes_mm - start.nodes_mm;
  RefinedNetwork coarse = coarsen_network(fine->network, model.network);
  result.coarsening_mm = coarse.distance_mm;
  result.report = std::move(deformed->report);
  flatten_rims(coarse.network);
  apply_dependencies(coarse.network);
  auto smooth = smooth_network(std::move(coarse.network), {}, progress);
  if (!smooth) return fail(smooth.error());
  result.angle_before_deg = smooth->before_deg;
  result.angle_after_deg = smooth->after_deg;
  result.model = model;
  result.model.network = std::move(smooth->network);
  for (const SmoothedPart& part : smooth->parts) {
    if (part.outcome != SmoothedPart::Outcome::kRefused) continue;
    result.model.warnings.push_back(
        fmt::format("{} could not be made smooth after the deformation: {}", part.name, part.why));
  }
  if (result.report.termination != Termination::kAtRest) {
    result.model.warnings.push_back(fmt::format("the deformation did not come to rest: {}",
                                                to_string(result.report.termination)));
  }
  return result;
}

}  // namespace angiospline
