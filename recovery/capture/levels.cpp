#include "recovery/capture/levels.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/median.h"
#include "recovery/capture/greys.h"
#include "recovery/capture/rules.h"

namespace angiospline {
namespace {

using namespace capture_rules;

// Over the measured stations within `reach` of station k, and itself.
double mean_around(const CaptureBranch& branch, const std::vector<double>& values, std::size_t k,
                   std::size_t reach) {
  double sum = 0, count = 0;
  for (std::size_t j = k > reach ? k - reach : 0; j <= std::min(values.size() - 1, k + reach);
       ++j) {
    if ((!branch.stations[j].clear && j != k) || !std::isfinite(values[j])) continue;
    sum += values[j];
    count += 1;
  }
  return sum / count;
}

std::vector<double> greys_in_discs(const GreyField& field,
                                   const std::vector<CaptureBranch>& branches, double reach) {
  std::vector<double> greys;
  for (const CaptureBranch& branch : branches) {
    for (std::size_t k = 0; k < branch.stations.size(); ++k) {
      for (const Disc::Cell& cell : disc_at(field, branch, k, reach).cells) {
        greys.push_back(cell.grey);
      }
    }
  }
  return greys;
}

}  // namespace

void measure_levels(const GreyField& field, CaptureBranch& branch) {
  const std::size_t n = branch.stations.size();
  std::vector<double> in(n), out(n);
  for (std::size_t k = 0; k < n; ++k) {
    in[k] = inside_of(field, branch.stations[k]);
    out[k] = outside_of(field, branch.stations[k]);
  }

  // Single sections scatter: the inside varies slowly along a vessel, the background faster.
  branch.levels.assign(n, {});
  const double spacing =
      (branch.stations.back().along - branch.stations.front().along) / static_cast<double>(n - 1);
  const double radius = branch.stations[n / 2].radius;
  const auto within = [&](double radii) {
    return static_cast<std::size_t>(std::ceil(radii * radius / spacing));
  };
  const std::size_t reach_in = within(kInsideRadii), reach_out = within(kOutsideRadii);
  for (std::size_t k = 0; k < n; ++k) {
    branch.levels[k].inside = mean_around(branch, in, k, reach_in);
    branch.levels[k].outside = mean_around(branch, out, k, reach_out);
  }
}

WallLevels levels_of_stations(const std::vector<CaptureBranch>& branches) {
  std::vector<double> in, out;
  for (const CaptureBranch& branch : branches) {
    for (std::size_t k = 0; k < branch.levels.size(); ++k) {
      if (!branch.stations[k].clear) continue;
      if (std::isfinite(branch.levels[k].inside)) in.push_back(branch.levels[k].inside);
      if (std::isfinite(branch.levels[k].outside)) out.push_back(branch.levels[k].outside);
    }
  }

  // Sections that a start of the wrong place puts beside the vessel are the darker ones.
  std::sort(in.begin(), in.end());
  return {in.empty() ? 0.0 : in[in.size() * 3 / 4], median(out)};
}

void fill_levels(const WallLevels& common, CaptureBranch& branch) {
  for (WallLevels& l : branch.levels) {
    const bool sound = std::isfinite(l.inside) && std::isfinite(l.outside) &&
                       l.contrast() > kNoEvidence * common.contrast();
    if (!sound) l = common;
  }
}

double noise_around(const GreyField& field, const std::vector<CaptureBranch>& branches) {
  const double voxel = field.voxel_mm();
  std::vector<double> deviations;
  for (const CaptureBranch& branch : branches) {
    for (const CaptureStation& s : branch.stations) {
      std::vector<double> greys;
      for (int k = 0; k < kSectionAngles; ++k) {
        const Vec3 p = s.center + (s.radius + kAroundVox * voxel) * s.direction(k, kSectionAngles);
        if (field.covers(p)) greys.push_back(field.at(p));
      }

      const double middle = median(greys);
      for (const double grey : greys) deviations.push_back(std::abs(grey - middle));
    }
  }
  return kNormalScale * median(std::move(deviations));
}

DiscLevels look_around(const GreyField& field, const std::vector<CaptureBranch>& branches) {
  std::vector<WallLevels> found;
  double most = 0;
  for (const double reach : kReaches) {
    found.push_back(two_levels(greys_in_discs(field, branches, reach)));
    most = std::max(most, found.back().contrast());
  }
  std::size_t k = 0;
  while (found[k].contrast() < kEnoughContrast * most) ++k;
  return {found[k], kReaches[k]};
}

void set_evidence(const GreyField& field, const WallLevels& common, CaptureBranch& branch) {
  const double voxel = field.voxel_mm();
  std::vector<double> steps;
  for (const CaptureStation& s : branch.stations) {
    if (!s.clear) continue;
    const double in = mean_on_ring(field, s, std::max(0.3 * s.radius, s.radius - voxel));
    const double out = mean_on_ring(field, s, s.radius + voxel);
    if (std::isfinite(in) && std::isfinite(out)) steps.push_back((in - out) / common.contrast());
  }

  // A branch without room to measure is led by its neighbours.
  double sum = 0;
  for (const double step : steps) sum += step;
  branch.evidence = steps.empty() ? 1.0 : sum / static_cast<double>(steps.size());
}

}  // namespace angiospline
