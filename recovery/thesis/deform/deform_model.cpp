#include "recovery/thesis/deform/deform_model.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "base/index.h"
#include "modeling/continuity/smooth_network.h"
#include "recovery/fit/fit_model.h"
#include "recovery/thesis/deform/mesh.h"
#include "recovery/thesis/deform/potentials.h"
#include "recovery/thesis/deform/rules.h"
#include "recovery/thesis/deform/solver.h"
#include "recovery/thesis/edges/edge_detection.h"
#include "recovery/thesis/edges/edge_localisation.h"

namespace angiospline {
namespace {

using namespace deform_rules;

// Rims' rows back into their planes; centres and radii anew, from points of the rims.
void flatten_rims(SurfaceNetwork& network) {
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

    // The rim's circle anew: the mean of its points and of their distances from it.
    Points3 points(3, std::ssize(rim.sides) * kRimPoints);
    Eigen::Index next = 0;
    for (const Side& side : rim.sides) {
      const BSplineSurface<3> surface = patch_surface(network, side.patch);
      for (int k = 0; k < kRimPoints; ++k) {
        const double along = (k + 0.5) / kRimPoints;
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
  std::vector<Eigen::Index> kept;
  for (Eigen::Index k = 0; k < edges.count(); ++k) {
    const bool beyond = std::any_of(rims.begin(), rims.end(), [&](const Rim& rim) {
      const Vec3 from = edges.at_mm.col(k) - rim.center_mm;
      const double along = from.dot(rim.normal);
      return along > 0 && along < kBesideRim * rim.radius_mm &&
             (from - along * rim.normal).norm() < kBesideRim * rim.radius_mm;
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

  // Means and largest values of each region, and of all of them at last.
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
  std::vector<std::string> names;
  std::vector<char> moves(index(nodes.cols()), 0);
  for (std::size_t r = 0; r < fine.regions.size(); ++r) {
    // A region stands and falls as a whole: by the share of its nodes that an edge pulls.
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

// The default solver, which is ours; the others are the thesis's and keep to its ways.
bool is_ours(const DeformModelOptions& options) { return options.method == DeformMethod::kSparse; }

// The places that pull: thick edges as the thesis has them (6.1), or thin ones between voxels.
Result<EdgePoints> edges_for(const Model& model, const Image<float>& image,
                             const DeformModelOptions& options, const Progress& progress) {
  EdgeOptions sought{EdgePercentile{options.edge_percentile}};
  if (is_ours(options)) sought.thinning = EdgeThinning::kAcross;
  const auto field = find_edges(image, sought, progress);
  if (!field) return fail(field.error());

  EdgePoints edges = edge_points(*field, image.grid);
  if (is_ours(options)) edges = between_voxels(std::move(edges), localise_edges(image, *field));
  return within_rims(edges, model.network.rims);
}

// How the first stage is solved.
DeformOptions options_for(const DeformMesh& start, const DeformModelOptions& options) {
  DeformOptions how =
      steady_options(options.method, start, options.potential, options.strength, options.reach_vox);
  how.most_iterations = options.most_iterations;
  how.potential.bright_inside = !options.dark;
  if (options.stiffness) how.elements.spring = *options.stiffness;
  if (!is_ours(options)) return how;

  how.elements.membrane = kPlateMembrane;
  how.elements.bending = kPlateBending;
  how.potential.farthest_vox = options.reach_vox;
  return how;
}

// The mesh at rest. Ours starts again from there, with its plates at rest, among near edges only.
Result<Deformation> run_stages(const DeformMesh& start, const EdgePoints& edges, double voxel_mm,
                               const DeformModelOptions& options, const Progress& progress) {
  DeformOptions how = options_for(start, options);
  auto deformed = deform(start, edges, voxel_mm, how, progress);
  if (!deformed) return deformed;

  int iterations = deformed->report.iterations;
  for (int again = 1; is_ours(options) && again < kStages; ++again) {
    if (deformed->report.termination == Termination::kUnstable) break;
    how.potential.farthest_vox = std::min(options.reach_vox, kNearVox);
    deformed = deform(deformed->mesh, edges, voxel_mm, how, progress);
    if (!deformed) return deformed;
    iterations += deformed->report.iterations;
  }
  deformed->report.iterations = iterations;
  return deformed;
}

struct SmoothPatches {
  SmoothedNetwork smooth;
  double coarsening_mm = 0.0;
};

// The deformed control mesh as the model's own patches again: the nearest ones in the mean square,
// rims flat, joins tangent-plane continuous with floating boundaries (3.2.1).
Result<SmoothPatches> back_to_patches(const SurfaceNetwork& fine, const SurfaceNetwork& original,
                                      const Progress& progress) {
  RefinedNetwork coarse = coarsen_network(fine, original);
  flatten_rims(coarse.network);
  apply_dependencies(coarse.network);
  auto smooth = smooth_network(std::move(coarse.network), {}, progress);
  if (!smooth) return fail(smooth.error());
  return SmoothPatches{std::move(*smooth), coarse.distance_mm};
}

// What a user should know of the result.
std::vector<Warning> warnings_of(const std::vector<SmoothedPart>& parts,
                                 const std::vector<std::string>& without_edge,
                                 Termination termination) {
  std::vector<Warning> warnings;
  for (const SmoothedPart& part : parts) {
    if (part.outcome != SmoothedPart::Outcome::kRefused) continue;
    warnings.push_back({WarningCode::kPartNotSmoothed,
                        fmt::format("{} could not be made smooth after the deformation: {}",
                                    part.name, part.why)});
  }
  for (const std::string& name : without_edge) {
    warnings.push_back(
        {WarningCode::kNoEdgeInImage,
         fmt::format("no edge found in the image near {}: it was left as it was", name)});
  }
  if (termination != Termination::kAtRest) {
    warnings.push_back(
        {WarningCode::kDeformationNotAtRest,
         fmt::format("the deformation did not come to rest: {}", to_string(termination))});
  }
  return warnings;
}

}  // namespace

Result<DeformedModel> deform_model(const Model& model, const Image<float>& image,
                                   const DeformModelOptions& options, const Progress& progress) {
  if (auto apart = frames_apart(model.network.control_points_mm, image.grid)) return fail(*apart);
  const auto edges = edges_for(model, image, options, progress);
  if (!edges) return fail(edges.error());

  // The finite-element mesh: points of the surface, a control mesh of finer knots (3.1).
  NetworkMeshOptions fineness;
  fineness.least_pieces = options.pieces;
  auto fine = refine_network(model.network, fineness);
  if (!fine) return fail(fine.error());
  DeformMesh start = control_mesh(fine->network);
  start.nodes_mm = points_of_columns(fine->network);

  const double voxel_mm = std::cbrt(image.grid.spacing_mm.prod());
  auto deformed = run_stages(start, *edges, voxel_mm, options, progress);
  if (!deformed) return fail(deformed.error());

  DeformedModel result;
  result.without_edge =
      hold_unpulled(fine->network, deformed->report, start.nodes_mm, deformed->mesh.nodes_mm);
  const Points3 moves = deformed->mesh.nodes_mm - start.nodes_mm;
  result.nodes = start.node_count();
  result.edges = static_cast<int>(edges->count());
  result.mesh = triangles_of(deformed->mesh, Caps::kFans);
  result.residual_force = residual_field(deformed->report, result.mesh);
  result.parts = figures_of_parts(fine->network, moves, deformed->report.residual_force);
  result.report = std::move(deformed->report);

  // Control points move as the points of the surface did that they stand for.
  fine->network.control_points_mm += moves;
  auto patches = back_to_patches(fine->network, model.network, progress);
  if (!patches) return fail(patches.error());
  result.coarsening_mm = patches->coarsening_mm;
  result.angle_before_deg = patches->smooth.before_deg;
  result.angle_after_deg = patches->smooth.after_deg;

  result.model = model;
  result.model.network = std::move(patches->smooth.network);
  for (Warning& warning :
       warnings_of(patches->smooth.parts, result.without_edge, result.report.termination)) {
    result.model.warnings.push_back(std::move(warning));
  }
  return result;
}

}  // namespace angiospline
