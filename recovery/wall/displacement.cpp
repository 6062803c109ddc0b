#include "recovery/wall/displacement.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include <tbb/parallel_for.h>

#include "base/contract.h"
#include "base/index.h"
#include "base/median.h"

namespace angiospline {
namespace {

constexpr double kLevelMean = 3.0;       // radii over which the wall is averaged for the levels
constexpr double kLeastContrast = 0.25;  // of the median: less is no wall
constexpr double kWaveVox = 32.0;        // L of SNR 1
constexpr double kWaveExponent = -0.4;
constexpr double kWaveRadii = 2.5;  // the longest L of factor one

std::vector<double> region_evidence(const GreyField& field, const FitMesh& mesh,
                                    const WallGreys& greys, const Eigen::VectorXd& displacement) {
  const int regions = *std::max_element(mesh.regions.begin(), mesh.regions.end()) + 1;
  std::vector<double> sum(index(regions), 0.0), count(index(regions), 0.0);
  for (std::size_t k = 0; k < mesh.nodes.size(); ++k) {
    const WallPoint p = parallel_point(mesh.nodes[k], displacement(static_cast<Eigen::Index>(k)));
    const double width = field.width_mm(p.normal);
    const double in = std::min(width, 0.9 / std::max(1e-300, p.largest_curvature));
    const Vec3 inner = p.point_mm - in * p.normal;
    const Vec3 outer = p.point_mm + width * p.normal;
    if (!field.covers(inner) || !field.covers(outer)) continue;
    sum[index(mesh.regions[k])] += (field.at(inner) - field.at(outer)) / greys.contrast;
    count[index(mesh.regions[k])] += 1;
  }
  for (std::size_t r = 0; r < sum.size(); ++r) sum[r] = count[r] > 0 ? sum[r] / count[r] : 0.0;
  return sum;
}

// The factor with the least expected squared error: from the rule's own, up or down while it falls.
void choose_wave(MeshSmoother& smoother, const Eigen::VectorXd& wanted,
                 const Eigen::VectorXd& weights, const Eigen::VectorXd& waves, double density,
                 const std::vector<double>& factors, const Progress& progress,
                 Displacement& result) {
  const Eigen::VectorXd mass = weights.cwiseProduct(smoother.mass_mm2());
  std::vector<std::optional<std::pair<double, double>>> known(factors.size());
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

}  // namespace

WallOffsets wall_offsets(const GreyField& field, const FitMesh& mesh, const WallGreys& greys,
                         const Eigen::VectorXd& displacement, double half_window) {
  const ProfileSag sag(field, mesh, greys, displacement, half_window);
  WallOffsets all{Eigen::VectorXd::Zero(mesh.size()), Eigen::VectorXd::Zero(mesh.size())};
  tbb::parallel_for(std::size_t{0}, mesh.nodes.size(), [&](std::size_t i) {
    const auto k = static_cast<Eigen::Index>(i);
    const WallLevels levels{greys.inside(k), greys.outside(k)};
    const bool clear = levels.contrast() >= kLeastContrast * greys.contrast;
    if (mesh.near_rim[i] || !clear) return;
    const WallPoint p = parallel_point(mesh.nodes[i], displacement(k));
    const WallOffset offset =
        wall_offset(field, p, levels, {half_window, std::min(greys.noise, greys.contrast)});
    if (!offset.measured) return;
    all.mm(k) = offset.offset_mm - sag.offset_mm(field, p);
    const double relative = levels.contrast() / greys.contrast;
    all.weight(k) =
        std::min(1.0, relative * relative) * 2 * half_window * field.voxel_mm() / offset.window_mm;
  });
  return all;
}

Displacement wall_displacement(const GreyField& field, const FitMesh& mesh, MeshSmoother& smoother,
                               const DisplacementOptions& options, const Progress& progress) {
  EXPECTS(mesh.size() > 0 && !options.half_windows_vox.empty());
  const Eigen::Index n = mesh.size();
  Displacement result;
  result.normal_mm = Eigen::VectorXd::Zero(n);
  Eigen::VectorXd waves(n), farthest(n);
  for (std::size_t round = 0; round < options.half_windows_vox.size(); ++round) {
    progress.at("wall",
                static_cast<double>(round) / static_cast<double>(options.half_windows_vox.size()));
    if (progress.should_stop()) return result;
    const bool last = round + 1 == options.half_windows_vox.size();
    if (options.greys != nullptr) {
      result.greys = *options.greys;
    } else if (round == 0 || last) {
      // The levels are taken from a smoother wall: one that follows the noise would have bright
      // noise inside and dark noise outside.
      const Eigen::VectorXd broad = smoother.mean(result.normal_mm, Eigen::VectorXd::Ones(n),
                                                  kLevelMean * median(mesh.radii_mm));
      result.greys = wall_greys(field, mesh, smoother, broad);
    }
    if (!(result.greys.contrast > 0)) break;
    const double wave = kWaveVox * std::pow(result.greys.snr(), kWaveExponent) * field.voxel_mm();
    for (Eigen::Index k = 0; k < n; ++k) {
      waves(k) = std::min(wave, kWaveRadii * mesh.radii_mm[index(k)]);
      farthest(k) = options.largest_move_radii * mesh.radii_mm[index(k)];
    }
    const double half = options.half_windows_vox[round];
    const WallOffsets offsets = wall_offsets(field, mesh, result.greys, result.normal_mm, half);
    const Eigen::VectorXd wanted = result.normal_mm + offsets.mm;
    Eigen::VectorXd weights = offsets.weight;
    if (progress.should_stop()) return result;
    Eigen::VectorXd smooth = smoother.fair(wanted, weights, result.wave_factor * waves);
    if (last && !progress.should_stop()) {
      weigh_outliers(wanted - smooth, offsets.weight, 0.1 * field.voxel_mm(), weights);
      if (options.wave_factors.size() == 1) {
        result.wave_factor = options.wave_factors.front();
      } else {
        const double density = result.greys.noise_density(field, half, smoother);
        choose_wave(smoother, wanted, weights, waves, density, options.wave_factors, progress,
                    result);
      }
      smooth = smoother.fair(wanted, weights, result.wave_factor * waves);
    }
    result.normal_mm = smooth.cwiseMin(farthest).cwiseMax(-farthest);
    result.residual_mm = wanted - result.normal_mm;
    result.weight = offsets.weight;
  }
  if (result.residual_mm.size() == 0) {
    result.residual_mm = result.weight = Eigen::VectorXd::Zero(n);
  }
  result.evidence = region_evidence(field, mesh, result.greys, result.normal_mm);
  return result;
}

}  // namespace angiospline
