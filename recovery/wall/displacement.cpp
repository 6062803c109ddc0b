#include "recovery/wall/displacement.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "base/contract.h"
#include "base/index.h"
#include "recovery/wall/rules.h"
#include "recovery/wall/wall_greys.h"

namespace angiospline {
namespace {

using namespace wall_rules;

// The factor with the least expected squared error: from the rule's own, up or down while it falls.
void choose_wave(MeshSmoother& smoother, const Eigen::VectorXd& wanted,
                 const Eigen::VectorXd& weights, const Eigen::VectorXd& waves, double density,
                 const std::vector<double>& factors, const Progress& progress,
                 Displacement& result) {
  const Eigen::VectorXd mass = weights.cwiseProduct(smoother.mass_mm2());
  std::vector<std::optional<std::pair<double, double>>> known(factors.size());

  // |f - value|^2 + 2 tr(H) noise: Mallows's C_p, up to a constant (Mallows: Some comments on C_p,
  // Technometrics 15, 1973).
  const auto expected = [&](int k) {
    auto& value = known[index(k)];
    if (!value) {
      const Eigen::VectorXd smooth = smoother.fair(wanted, weights, factors[index(k)] * waves);
      const double freedom = smoother.degrees_of_freedom();
      value = {mass.dot((smooth - wanted).cwiseAbs2()) + 2 * density * freedom, freedom};
    }
    return value->first;
  };

  const int last = static_cast<int>(factors.size()) - 1;
  // Each factor costs a factorisation of the whole wall: between them the caller may stop.
  const auto better = [&](int other, int than) {
    return !progress.should_stop() && expected(other) < expected(than);
  };
  int k = last / 2;
  if (k < last && better(k + 1, k)) {
    while (k < last && better(k + 1, k)) ++k;
  } else {
    while (k > 0 && better(k - 1, k)) --k;
  }
  expected(k);
  result.wave_factor = factors[index(k)];
  result.degrees_of_freedom = known[index(k)]->second;
}

// The rule's own waves: shorter ones are noise at this SNR, and none is longer than a few radii.
Eigen::VectorXd waves_of(const Evidence& evidence, const FitMesh& mesh) {
  const double wave = kWaveVox * std::pow(evidence.snr(), kWaveExponent) * evidence.voxel_mm();
  Eigen::VectorXd waves(mesh.size());
  for (Eigen::Index k = 0; k < waves.size(); ++k) {
    waves(k) = std::min(wave, kWaveRadii * mesh.radii_mm[index(k)]);
  }
  return waves;
}

Eigen::VectorXd farthest_moves(const FitMesh& mesh, double radii) {
  Eigen::VectorXd farthest(mesh.size());
  for (Eigen::Index k = 0; k < farthest.size(); ++k) farthest(k) = radii * mesh.radii_mm[index(k)];
  return farthest;
}

}  // namespace

Displacement wall_displacement(Evidence& evidence, const FitMesh& mesh, MeshSmoother& smoother,
                               const DisplacementOptions& options, const Progress& progress) {
  EXPECTS(mesh.size() > 0 && !options.half_windows_vox.empty());
  const Eigen::Index n = mesh.size();
  Displacement result;
  result.normal_mm = result.residual_mm = result.weight = Eigen::VectorXd::Zero(n);
  for (std::size_t round = 0; round < options.half_windows_vox.size(); ++round) {
    progress.at("wall",
                static_cast<double>(round) / static_cast<double>(options.half_windows_vox.size()));
    if (progress.should_stop()) return result;
    const bool last = round + 1 == options.half_windows_vox.size();
    if (round == 0 || last) evidence.look(mesh, smoother, result.normal_mm);
    if (!evidence.found()) break;

    // The total displacement that is asked for, from the mesh as it was given.
    const double half = options.half_windows_vox[round];
    const WallOffsets offsets = evidence.offsets(mesh, result.normal_mm, half);
    const Eigen::VectorXd wanted = result.normal_mm + offsets.mm;
    if (progress.should_stop()) return result;

    const Eigen::VectorXd waves = waves_of(evidence, mesh);
    Eigen::VectorXd smooth = smoother.fair(wanted, offsets.weight, result.wave_factor * waves);
    if (last && !progress.should_stop()) {
      Eigen::VectorXd weights = offsets.weight;
      weigh_outliers(wanted - smooth, offsets.weight, kOutlierFloorVox * evidence.voxel_mm(),
                     weights);
      if (options.wave_factors.size() == 1) {
        result.wave_factor = options.wave_factors.front();
      } else {
        const double density = evidence.noise_density(half, smoother);
        choose_wave(smoother, wanted, weights, waves, density, options.wave_factors, progress,
                    result);
      }
      smooth = smoother.fair(wanted, weights, result.wave_factor * waves);
    }

    const Eigen::VectorXd farthest = farthest_moves(mesh, options.largest_move_radii);
    result.normal_mm = smooth.cwiseMin(farthest).cwiseMax(-farthest);
    result.residual_mm = wanted - result.normal_mm;
    result.weight = offsets.weight;
  }
  result.evidence = evidence.support(mesh, result.normal_mm);
  return result;
}

}  // namespace angiospline
