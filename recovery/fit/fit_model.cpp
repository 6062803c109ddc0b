#include "recovery/fit/fit_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "base/index.h"
#include "recovery/capture/capture.h"
#include "recovery/fit/closed_surface.h"
#include "recovery/fit/fit_network.h"
#include "recovery/fit/reduction.h"
#include "recovery/fit/refit.h"
#include "recovery/fit/rings.h"
#include "recovery/fit/rules.h"
#include "recovery/wall/displacement.h"
#include "recovery/wall/evidence_of_greys.h"
#include "recovery/wall/wall_mesh.h"

namespace angiospline {
namespace {

using namespace fit_rules;

// Displacements of a region without edge are zero, and so is the pull on its neighbours.
void hold_regions(const FitMesh& mesh, const std::vector<char>& hold, Displacement& displacement) {
  for (int k = 0; k < mesh.size(); ++k) {
    if (hold[index(mesh.regions[index(k)])]) displacement.normal_mm(k) = displacement.weight(k) = 0;
  }
}

Image<float> negated(const Image<float>& image) {
  Image<float> other = image;
  for (float& v : other.voxels) v = -v;
  return other;
}

class Fitter {
 public:
  Fitter(const Image<float>& image, const FitOptions& options, const Progress& progress)
      : brightened_(options.dark ? negated(image) : Image<float>()),
        field_(options.dark ? brightened_ : image),
        options_(options),
        progress_(progress) {}

  Result<FittedModel> run(const CenterlineTree& tree) {
    if (const auto apart = check_frames(points_of(tree))) return fail(*apart);
    const auto captured = capture_tree(tree, field_, progress_);
    if (!captured) return fail(captured.error());
    auto seeded = build_model(captured->tree, options_.build, progress_);
    if (!seeded) return fail(seeded.error());
    FittedModel fitted{std::move(*seeded), {}};
    fitted.report.mean_axis_move_mm = captured->mean_move_mm;
    fitted.report.recaptured = captured->recaptured;
    fitted.report.iterations = captured->rounds;
    for (const std::string& name : captured->left_alone) {
      fitted.report.without_edge.push_back("wall_" + name);
    }
    return refined(std::move(fitted), options_.rounds);
  }

  Result<FittedModel> run(const Model& model) {
    if (const auto apart = check_frames(model.network.control_points_mm)) return fail(*apart);
    FittedModel fitted{model, {}};
    if (!options_.capture) return refined(std::move(fitted), options_.rounds);

    double radius = 0;
    const std::vector<std::vector<int>> closed = closed_patches(model.network);
    for (std::size_t r = 0; r < closed.size(); ++r) {
      if (!closed[r].empty()) radius = std::max(radius, model.network.regions[r].radius_mm);
    }

    // A closed surface has no centerline to be led by: it is captured by its own wall, in windows
    // that become narrower.
    if (radius == 0) return refined(std::move(fitted), options_.rounds);

    const double least = options_.displacement.half_windows_vox.front();
    for (const double share : kCaptureWindows) {
      DisplacementOptions wide = options_.displacement;
      const double window = std::max(least, share * radius / field_.voxel_mm());
      wide.half_windows_vox = {window, std::max(least, window / 2)};
      if (auto moved = refine(fitted.model.network, fitted.report, wide); !moved) {
        return fail(moved.error());
      }
    }
    return refined(std::move(fitted), std::max(options_.rounds, kClosedRounds));
  }

 private:
  static Points3 points_of(const CenterlineTree& tree) {
    Eigen::Index count = 0;
    for (const CenterlineBranch& branch : tree.branches) count += branch.points_mm.cols();
    Points3 points(3, count);
    count = 0;
    for (const CenterlineBranch& branch : tree.branches) {
      points.middleCols(count, branch.points_mm.cols()) = branch.points_mm;
      count += branch.points_mm.cols();
    }
    return points;
  }

  std::optional<Error> check_frames(const Points3& p) const {
    return frames_apart(p, field_.image().grid);
  }

  Result<FittedModel> refined(FittedModel fitted, int rounds) {
    SurfaceNetwork& network = fitted.model.network;
    network = with_finer_bodies(network, options_.body_spans);

    for (int round = 0; round < rounds; ++round) {
      if (auto moved = refine(network, fitted.report, options_.displacement); !moved) {
        return fail(moved.error());
      }
    }

    if (auto fine = refit_where_large(field_, options_, network, fitted.report, progress_); !fine) {
      return fail(fine.error());
    }

    for (const std::string& name : fitted.report.without_edge) {
      fitted.model.warnings.push_back(
          {WarningCode::kNoWallInImage,
           fmt::format("no wall found in the image near {}: it was left as it was", name)});
    }
    for (const HeldRegion& held : fitted.report.held) {
      fitted.model.warnings.push_back(
          {WarningCode::kRegionNotRefined,
           fmt::format("{} was not refined to the image: {}", held.name, held.why)});
    }

    fitted.report.control_points_before_reduction =
        static_cast<int>(network.control_points_mm.cols());
    reduce(network, fitted.report);
    fitted.report.control_points = static_cast<int>(network.control_points_mm.cols());
    return fitted;
  }

  void reduce(SurfaceNetwork& network, FitReport& report) const {
    report.reduction_mm = options_.reduction * field_.voxel_mm() / report.snr;
    if (report.reduction_mm > 0) network = with_fewer_knots(network, report.reduction_mm);
  }

  // Moves the network to its evidence once.
  Result<void> refine(SurfaceNetwork& network, FitReport& report,
                      const DisplacementOptions& options) {
    FitMeshOptions spacing;
    spacing.voxel_mm = field_.voxel_mm();
    auto mesh = make_fit_mesh(network, spacing, progress_);
    if (!mesh) return fail(mesh.error());
    MeshSmoother smoother(*mesh);

    EvidenceOfGreys evidence(field_);
    Displacement displacement = wall_displacement(evidence, *mesh, smoother, options, progress_);
    if (progress_.should_stop()) return fail(cancelled("wall"));
    report.contrast = evidence.greys().contrast;
    report.noise = evidence.greys().noise;
    report.noise_kind = evidence.greys().kind;
    report.snr = evidence.greys().snr();
    report.nodes = mesh->size();
    report.iterations += static_cast<int>(options.half_windows_vox.size());
    report.degrees_of_freedom = displacement.degrees_of_freedom;
    report.wave_factor = displacement.wave_factor;
    if (!(report.contrast > 0)) return fail(no_contrast(report.contrast));

    // Walls that the image does not show stay, and the others are moved around them.
    hold_regions(*mesh, without_edge(network, displacement, report), displacement);
    auto moved = move_network(network, *mesh, displacement.normal_mm, progress_);
    if (!moved) return fail(moved.error());
    network = std::move(moved->network);
    report.held = std::move(moved->held);
    const Eigen::VectorXd& mass = smoother.mass_mm2();
    report.mean_move_mm = mass.dot(displacement.normal_mm.cwiseAbs()) / mass.sum();
    return {};
  }

  Error no_contrast(double contrast) const {
    return {ErrorKind::kBadInput,
            fmt::format("the vessel is not {} than its background",
                        options_.dark ? "darker" : "brighter"),
            "fit", fmt::format("{:.4g}", contrast),
            options_.dark ? "grey outside minus grey inside the model's wall must be "
                            "positive; bright vessels need no --dark"
                          : "grey inside minus grey outside the model's wall must be "
                            "positive; dark vessels need --dark"};
  }

  // Which regions have no edge in the image, now or before; the report names them.
  static std::vector<char> without_edge(const SurfaceNetwork& network,
                                        const Displacement& displacement, FitReport& report) {
    std::vector<char> hold(network.regions.size(), 0);
    std::vector<std::string>& names = report.without_edge;
    for (std::size_t r = 0; r < displacement.evidence.size(); ++r) {
      const std::string& name = network.regions[r].name;
      const bool listed = std::find(names.begin(), names.end(), name) != names.end();
      hold[r] = listed || displacement.evidence[r] < kEvidence;
      if (hold[r] && !listed) names.push_back(name);
    }
    return hold;
  }

  Image<float> brightened_;  // dark vessels made bright
  GreyField field_;
  const FitOptions& options_;
  const Progress& progress_;
};

}  // namespace

std::optional<Error> frames_apart(const Points3& points_mm, const ImageGrid& grid) {
  Eigen::Index covered = 0;
  for (Eigen::Index c = 0; c < points_mm.cols(); ++c) {
    const Vec3 x = grid.index_vox(points_mm.col(c));
    bool inside = true;
    for (int i = 0; i < 3; ++i) {
      inside = inside && x(i) >= -0.5 && x(i) <= grid.size[index(i)] - 0.5;
    }
    covered += inside ? 1 : 0;
  }

  const double share = static_cast<double>(covered) / static_cast<double>(points_mm.cols());
  if (share >= kLeastCovered) return {};

  const Vec3 center = points_mm.rowwise().mean();
  const Vec3 middle = grid.world_mm(
      Vec3((grid.size[0] - 1) / 2.0, (grid.size[1] - 1) / 2.0, (grid.size[2] - 1) / 2.0));
  return Error{
      ErrorKind::kBadInput, "the model lies outside the image", "fit",
      fmt::format("{:.0f} % of its points are inside; the model is centred at "
                  "({:.4g}, {:.4g}, {:.4g}), the image at ({:.4g}, {:.4g}, {:.4g})",
                  100 * share, center(0), center(1), center(2), middle(0), middle(1), middle(2)),
      "both in one frame (LPS, mm), with half of the model inside the image"};
}

Result<Image<float>> grey_image(const AnyImage& image, const std::string& file) {
  const ImageGrid& grid = grid_of(image);
  for (const int n : grid.size) {
    if (n < 4) {
      return fail({ErrorKind::kBadInput, "the image is too small", file,
                   fmt::format("{} x {} x {} voxels", grid.size[0], grid.size[1], grid.size[2]),
                   "at least 4 voxels along each axis"});
    }
  }

  Image<float> grey(grid);
  std::visit(
      [&](const auto& typed) {
        for (std::size_t i = 0; i < grey.voxels.size(); ++i) {
          grey.voxels[i] = static_cast<float>(typed.voxels[i]);
        }
      },
      image);

  float least = std::numeric_limits<float>::infinity(), most = -least;
  for (std::size_t i = 0; i < grey.voxels.size(); ++i) {
    const float value = grey.voxels[i];
    if (!std::isfinite(value)) {
      const Voxel v = grid.voxel(i);
      return fail({ErrorKind::kBadInput, "voxel is not a number",
                   fmt::format("{}, voxel ({}, {}, {})", file, v[0], v[1], v[2]),
                   fmt::format("{}", value), "grey values are finite"});
    }
    least = std::min(least, value);
    most = std::max(most, value);
  }

  if (!(most > least)) {
    return fail({ErrorKind::kBadInput, "the image is constant", file, fmt::format("{}", least),
                 "vessels differ from their background"});
  }
  return grey;
}

Result<FittedModel> fit_tree(const CenterlineTree& tree, const Image<float>& image,
                             const FitOptions& options, const Progress& progress) {
  if (tree.branches.empty()) {
    return fail({ErrorKind::kBadInput, "the tree has no branches", tree.source, {}, {}});
  }
  return Fitter(image, options, progress).run(tree);
}

Result<FittedModel> fit_model(const Model& model, const Image<float>& image,
                              const FitOptions& options, const Progress& progress) {
  if (model.network.patches.empty()) {
    return fail({ErrorKind::kBadInput, "the model has no surfaces", model.name, {}, {}});
  }
  if (!options.capture || model.tree.branches.empty()) {
    return Fitter(image, options, progress).run(model);
  }
  auto fitted = fit_tree(model.tree, image, options, progress);
  if (fitted) {
    fitted->model.name = model.name;
    fitted->model.assumptions = model.assumptions;
  }
  return fitted;
}

MeshField wall_residual(const Model& model, const Tessellation& tessellation,
                        const Image<float>& image, const FitOptions& options,
                        const Progress& progress) {
  const Image<float> brightened = options.dark ? negated(image) : Image<float>();
  const GreyField field(options.dark ? brightened : image);
  FitMeshOptions spacing;
  spacing.voxel_mm = field.voxel_mm();

  const FitMesh mesh = fit_mesh_of(model.network, tessellation, spacing);
  MeshSmoother smoother(mesh);

  DisplacementOptions one_round = options.displacement;
  one_round.half_windows_vox = {options.displacement.half_windows_vox.back()};
  one_round.wave_factors = {1.0};
  EvidenceOfGreys evidence(field);
  const Displacement left = wall_displacement(evidence, mesh, smoother, one_round, progress);

  MeshField residual{"residual_mm",
                     Eigen::VectorXd::Constant(tessellation.mesh.points_mm.cols(),
                                               std::numeric_limits<double>::quiet_NaN())};
  if (progress.should_stop()) return residual;
  for (int k = 0; k < mesh.size(); ++k) {
    if (left.weight(k) > 0) residual.values(mesh.points[index(k)]) = left.normal_mm(k);
  }
  return residual;
}

}  // namespace angiospline
