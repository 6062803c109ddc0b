#include "recovery/fit/refit.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "base/index.h"
#include "base/median.h"
#include "modeling/check/certificate.h"
#include "recovery/fit/fit_network.h"
#include "recovery/fit/refinement.h"
#include "recovery/fit/rules.h"
#include "recovery/wall/displacement.h"
#include "recovery/wall/evidence_of_greys.h"
#include "recovery/wall/wall_mesh.h"
#include "recovery/wall/wall_mesh_part.h"

namespace angiospline {
namespace {

using namespace fit_rules;

bool listed(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}
bool listed(const std::vector<HeldRegion>& held, const std::string& name) {
  return std::any_of(held.begin(), held.end(), [&](const HeldRegion& h) { return h.name == name; });
}

// Levels measured once, on the whole wall: they vary over several radii, rounds move nodes by less.
struct KnownLevels {
  FitMesh mesh;
  WallGreys greys;

  WallGreys on(const FitMesh& other) const {
    WallGreys here = greys;
    const std::vector<int> nearest = nearest_nodes(mesh, other);
    here.inside.resize(other.size());
    here.outside.resize(other.size());
    for (int k = 0; k < other.size(); ++k) {
      here.inside(k) = greys.inside(nearest[index(k)]);
      here.outside(k) = greys.outside(nearest[index(k)]);
    }
    return here;
  }
};

FitMeshPart whole_of(FitMesh mesh) {
  FitMeshPart part;
  part.nodes.resize(mesh.nodes.size());
  std::iota(part.nodes.begin(), part.nodes.end(), 0);
  part.mesh = std::move(mesh);
  return part;
}

class Refit {
 public:
  Refit(const GreyField& field, const FitOptions& options, SurfaceNetwork& network,
        FitReport& report, const Progress& progress)
      : field_(field),
        options_(options),
        network_(network),
        report_(report),
        progress_(progress),
        excluded_(network.regions.size(), 0),
        amounts_(network.regions.size(), std::numeric_limits<double>::infinity()) {
    spacing_.voxel_mm = field.voxel_mm();
    spacing_.rim_margin_vox = kRefit.rim_vox;

    // What could not be moved before is not looked at.
    for (std::size_t r = 0; r < excluded_.size(); ++r) {
      const std::string& name = network.regions[r].name;
      excluded_[r] = listed(report.held, name) || listed(report.without_edge, name);
    }
  }

  Result<void> run() {
    const SurfaceNetwork before = network_;
    double waves = 0.5;
    for (int round = 0; round < options_.refinements; ++round, waves /= 2) {
      if (progress_.should_stop()) return fail(cancelled("refinement"));
      const auto went_on = one_round(round == 0, waves);
      if (!went_on) return fail(went_on.error());
      if (!*went_on) break;
    }
    if (!report_.refined.empty()) keep_if_sound(before);
    return {};
  }

 private:
  // Whether anything moved.
  Result<bool> one_round(bool first, double waves) {
    auto mesh = make_fit_mesh(network_, spacing_, progress_);
    if (!mesh) return fail(mesh.error());
    const FitMeshPart part =
        first ? whole_of(std::move(*mesh)) : part_near(*mesh, places_, reach_mm());

    MeshSmoother smoother(part.mesh);
    if (first) measure_levels(part.mesh, smoother);
    const EvidenceOfGreys evidence(field_, first ? levels_.greys : levels_.on(part.mesh));
    LargeResiduals large = large_residuals(evidence, network_, part.mesh, smoother, excluded_);

    leave_out_stuck(part.mesh, large);
    if (progress_.should_stop()) return fail(cancelled("refinement"));
    if (!large.any()) return false;

    const Eigen::VectorXd share = share_of(part.mesh, large.large, smoother);
    const LocallyRefinedNetwork finer = refined_where_large(
        network_, part.mesh, large, share, kRefit.shortest_span_vox * field_.voxel_mm());
    mark_places(part.mesh, large.large);
    return move(finer, part.mesh, large, waves);
  }

  void measure_levels(const FitMesh& mesh, MeshSmoother& smoother) {
    levels_ = {mesh, wall_greys(field_, mesh, smoother, Eigen::VectorXd::Zero(mesh.size()))};
    around_mm_ = std::max(ResidualOptions().mean_vox * field_.voxel_mm(),
                          kRefit.reach_radii * median(mesh.radii_mm));
  }

  double reach_mm() const {
    return kRefit.share_reach * around_mm_ + kRefit.longest_wave_vox * field_.voxel_mm();
  }

  void mark_places(const FitMesh& mesh, const std::vector<char>& large) {
    std::vector<Vec3> points;
    for (std::size_t k = 0; k < large.size(); ++k) {
      if (large[k]) points.push_back(mesh.nodes[k].point_mm);
    }
    places_.resize(3, std::ssize(points));
    for (std::size_t k = 0; k < points.size(); ++k) {
      places_.col(static_cast<Eigen::Index>(k)) = points[k];
    }
  }

  // Of each node's move. None in regions that are not to be touched.
  Eigen::VectorXd share_of(const FitMesh& mesh, const std::vector<char>& marks,
                           MeshSmoother& smoother) const {
    Eigen::VectorXd share = share_around(marks, smoother, around_mm_);
    for (int k = 0; k < mesh.size(); ++k) {
      if (excluded_[index(mesh.regions[index(k)])]) share(k) = 0;
    }
    return share;
  }

  // Regions whose large residuals the round before did not make smaller.
  void leave_out_stuck(const FitMesh& mesh, LargeResiduals& large) {
    for (std::size_t r = 0; r < excluded_.size(); ++r) {
      if (!large.regions[r] || amounts_[r] == 0) continue;
      if (large.amounts_mm3[r] < kRefit.progress * amounts_[r]) continue;
      excluded_[r] = 1;
      large.leave_out(mesh, static_cast<int>(r));
    }
    amounts_ = large.amounts_mm3;
  }

  // Fits the finer network around the places. Regions that could not go the whole way are left out
  // and the others go without them. Whether any went.
  Result<bool> move(const LocallyRefinedNetwork& finer, const FitMesh& looked_at,
                    const LargeResiduals& large, double waves) {
    const auto mesh = make_fit_mesh(finer.network, spacing_, progress_);
    if (!mesh) return fail(mesh.error());
    const FitMeshPart part = part_near(*mesh, places_, reach_mm());
    MeshSmoother smoother(part.mesh);

    EvidenceOfGreys evidence(field_, levels_.on(part.mesh));
    DisplacementOptions local = options_.displacement;
    local.wave_factors = {waves};
    const Displacement wall = wall_displacement(evidence, part.mesh, smoother, local, progress_);
    report_.iterations += static_cast<int>(local.half_windows_vox.size());

    // Marks go over to the finer mesh by the nearest nodes.
    std::vector<char> marks(part.mesh.nodes.size(), 0);
    const std::vector<int> nearest = nearest_nodes(looked_at, part.mesh);
    for (std::size_t k = 0; k < marks.size(); ++k) marks[k] = large.large[index(nearest[k])];

    // Regions that cannot move are left out, the others tried without them.
    while (std::find(marks.begin(), marks.end(), char{1}) != marks.end()) {
      if (progress_.should_stop()) return fail(cancelled("refinement"));
      const Eigen::VectorXd share = share_of(part.mesh, marks, smoother);
      auto moved =
          move_network(finer.network, *mesh,
                       part.spread(wall.normal_mm.cwiseProduct(share), mesh->size()), progress_);
      if (!moved) return fail(moved.error());
      if (!exclude_held(moved->held, large)) {
        network_ = std::move(moved->network);
        name_refined(finer.regions);
        return true;
      }
      for (std::size_t k = 0; k < marks.size(); ++k) {
        if (excluded_[index(part.mesh.regions[k])]) marks[k] = 0;
      }
    }
    return false;
  }

  // Excludes the regions that were to move and could not; whether there are any.
  bool exclude_held(const std::vector<HeldRegion>& held, const LargeResiduals& large) {
    bool any = false;
    for (std::size_t r = 0; r < excluded_.size(); ++r) {
      if (excluded_[r] || !large.regions[r] || !listed(held, network_.regions[r].name)) continue;
      excluded_[r] = 1;
      any = true;
    }
    return any;
  }

  void name_refined(const std::vector<std::string>& names) {
    for (std::size_t r = 0; r < excluded_.size(); ++r) {
      const std::string& name = network_.regions[r].name;
      if (excluded_[r] || !listed(names, name) || listed(report_.refined, name)) continue;
      report_.refined.push_back(name);
    }
  }

  // Finer walls that cross themselves are not kept.
  void keep_if_sound(const SurfaceNetwork& before) {
    const auto certificate = certify(network_);
    if (certificate && !certificate->self_intersecting) return;
    network_ = before;
    for (const std::string& name : report_.refined) {
      report_.held.push_back(
          {name, "with more knots where its residual is large it crosses itself"});
    }
    report_.refined.clear();
  }

  const GreyField& field_;
  const FitOptions& options_;
  SurfaceNetwork& network_;
  FitReport& report_;
  const Progress& progress_;
  FitMeshOptions spacing_;
  std::vector<char> excluded_;   // regions that are not to be moved
  std::vector<double> amounts_;  // of large residuals in each region the round before
  KnownLevels levels_;
  double around_mm_ = 0.0;
  Points3 places_;  // nodes where residuals were large
};

}  // namespace

Result<void> refit_where_large(const GreyField& field, const FitOptions& options,
                               SurfaceNetwork& network, FitReport& report,
                               const Progress& progress) {
  return Refit(field, options, network, report, progress).run();
}

}  // namespace angiospline
