#include "recovery/thesis/deform/deform_model.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "base/index.h"
#include "recovery/fit/fit_model.h"
#include "recovery/thesis/edges/edge_localisation.h"

namespace angiospline {
namespace {

// Of the default solver. Thin plates keep spurious edges from denting the wall; the membranes of
// the small meshes of DeformOptions resist a change of radius, so they are left out. Each stage
// starts at rest where the last one ended, so that plates resist only what the next one adds.
constexpr double kBending = 10.0;
constexpr int kStages = 3;
constexpr double kNear = 2.0;  // voxels: edges pull no farther once the first stage is done

// Rims' rows back into their planes; centres and radii anew, from points of the rims.
void flatten_rims(SurfaceNetwork& network) {
  constexpr int kPoints = 16;  // of each side
  for (Rim& rim : network.rims) {
    for (const Side& side : rim.sides) {
      const Patch& patch = network.patches[index(side.patch)];
      const int nu = patch.u.control_point_count(), nv = patch.v.control_point_count();
      const bool along_v = side.side == PatchSide::kU0 || side.side == PatchSide::kU1;
      for (int k = 0; k < (along_v ? nv : nu); ++k) {
        const int i = along_v ? (side.side == PatchSide::kU0 ? 0 : nu - 1) : k;
        const int j = along_v ? k : (side.side == PatchSide::kV0 ? 0 : nv - 1);
        auto p = network.control_points_mm.col(patch.control[index(i * nv + j)]);
        p -= rim.normal.dot(p - rim.center_mm) * rim.normal;
      }
    }
    Points3 points(3, std::ssize(rim.sides) * kPoints);
    Eigen::Index next = 0;
    for (const Side& side : rim.sides) {
      const BSplineSurface<3> surface = patch_surface(network, side.patch);
      for (int k = 0; k < kPoints; ++k) {
        const double along = (k + 0.5) / kPoints;
        const Vec2 uv = side_parameters(network.patches[index(side.patch)], side.side, along);
        points.col(next++) = surface.at(uv.x(), uv.y());
      }
    }
    rim.center_mm = points.rowwise().mean();
    rim.radius_mm = (points.colwise() - rim.center_mm).colwise().norm().mean();
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

// Edges that no open end's plane cuts off: a vessel that goes on past the model, or is round there,
// would pull the end's nodes along its axis and together.
EdgePoints within_rims(const EdgePoints& edges, const std::vector<Rim>& rims) {
  constexpr double kBeside = 2.0;  // radii: what is farther from the axis belongs to something else
  std::vector<Eigen::Index> kept;
  for (Eigen::Index k = 0; k < edges.count(); ++k) {
    const bool beyond = std::any_of(rims.begin(), rims.end(), [&](const Rim& rim) {
      const Vec3 from = edges.at_mm.col(k) - rim.center_mm;
      const double along = from.dot(rim.normal);
      return along > 0 && along < kBeside * rim.radius_mm &&
             (from - along * rim.normal).norm() < kBeside * rim.radius_mm;
    });
    if (!beyond) kept.push_back(k);
  }
  return {edges.at_mm(Eigen::all, kept), edges.normals(Eigen::all, kept), edges.strength(kept)};
}

EdgePoints between_voxels(EdgePoints edges, const std::vector<EdgePlace>& places) {
  for (Eigen::Index k = 0; k < edges.count(); ++k) {
    edges.at_mm.col(k) = places[index(k)].point_mm;
    edges.normals.col(k) = -places[index(k)].normal;
  }
  return edges;
}

// Pool columns of the refined network are the mesh's nodes.
std::vector<PartFigures> figures_of_parts(const SurfaceNetwork& fine, const Points3& moves,
                                          const Eigen::VectorXd& forces) {
  std::vector<std::vector<char>> of_region(fine.regions.size() + 1,
                                           std::vector<char>(index(moves.cols()), 0));
  for (const Patch& patch : fine.patches) {
    for (const int c : patch.control) of_region[index(patch.region)][index(c)] = 1;
  }
  of_region.back().assign(index(moves.cols()), 1);
  std::vector<PartFigures> parts;
  for (std::size_t r = 0; r < of_region.size(); ++r) {
    PartFigures part;
    part.name = r < fine.regions.size() ? fine.regions[r].name : "all";
    double count = 0;
    for (Eigen::Index k = 0; k < moves.cols(); ++k) {
      if (!of_region[r][index(k)]) continue;
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

// Regions near which hardly any edge pulls go back to where they were, but for the nodes that they
// share with others. Their names.
std::vector<std::string> hold_unpulled(const SurfaceNetwork& fine, const DeformReport& report,
                                       const Points3& start, Points3& nodes) {
  constexpr double kLeastPulled = 0.1;  // share of a region's nodes
  std::vector<std::string> names;
  std::vector<char> moves(index(nodes.cols()), 0);
  for (std::size_t r = 0; r < fine.regions.size(); ++r) {
    int count = 0, pulled = 0;
    for (const Patch& patch : fine.patches) {
      if (index(patch.region) != r) continue;
      for (const int c : patch.control) {
        ++count;
        pulled += report.edges_per_node[index(c)] > 0 ? 1 : 0;
      }
    }
    if (pulled < kLeastPulled * count) {
      names.push_back(fine.regions[r].name);
      continue;
    }
    for (const Patch& patch : fine.patches) {
      if (index(patch.region) != r) continue;
      for (const int c : patch.control) moves[index(c)] = 1;
    }
  }
  for (Eigen::Index k = 0; k < nodes.cols(); ++k) {
    if (!moves[index(k)]) nodes.col(k) = start.col(k);
  }
  return names;
}

}  // namespace

Result<DeformedModel> deform_model(const Model& model, const Image<float>& image,
                                   const DeformModelOptions& options, const Progress& progress) {
  if (auto apart = frames_apart(model.network.control_points_mm, image.grid)) return fail(*apart);
  const bool ours = options.method == DeformMethod::kSparse;
  EdgeOptions sought{EdgePercentile{options.edge_percentile}};
  if (ours) sought.thinning = EdgeThinning::kAcross;
  const auto field = find_edges(image, sought, progress);
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
  EdgePoints edges = edge_points(*field, image.grid);
  if (ours) edges = between_voxels(std::move(edges), localise_edges(image, *field));
  edges = within_rims(edges, model.network.rims);
  if (ours) {
    how.elements.membrane = 0.0;
    how.elements.bending = kBending;
    how.potential.farthest_vox = options.reach_vox;
  }
  auto deformed = deform(start, edges, voxel, how, progress);
  int iterations = deformed ? deformed->report.iterations : 0;
  for (int again = 0; ours && deformed && again < kStages - 1; ++again) {
    if (deformed->report.termination == Termination::kUnstable) break;
    how.potential.farthest_vox = std::min(options.reach_vox, kNear);
    deformed = deform(deformed->mesh, edges, voxel, how, progress);
    if (deformed) iterations += deformed->report.iterations;
  }
  if (!deformed) return fail(deformed.error());
  deformed->report.iterations = iterations;

  DeformedModel result;
  result.without_edge =
      hold_unpulled(fine->network, deformed->report, start.nodes_mm, deformed->mesh.nodes_mm);
  result.nodes = start.node_count();
  result.edges = static_cast<int>(edges.count());
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
        {WarningCode::kPartNotSmoothed,
         fmt::format("{} could not be made smooth after the deformation: {}", part.name,
                     part.why)});
  }
  for (const std::string& name : result.without_edge) {
    result.model.warnings.push_back(
        {WarningCode::kNoEdgeInImage,
         fmt::format("no edge found in the image near {}: it was left as it was", name)});
  }
  if (result.report.termination != Termination::kAtRest) {
    result.model.warnings.push_back(
        {WarningCode::kDeformationNotAtRest, fmt::format("the deformation did not come to rest: {}",
                                                         to_string(result.report.termination))});
  }
  return result;
}

}  // namespace angiospline
