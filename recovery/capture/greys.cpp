#include "recovery/capture/greys.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/median.h"
#include "recovery/capture/rules.h"

namespace angiospline {
namespace {

using namespace capture_rules;

}  // namespace

double mean_on_ring(const GreyField& field, const CaptureStation& s, double radius) {
  double sum = 0;
  int count = 0;
  for (int k = 0; k < kSectionAngles; ++k) {
    const Vec3 p = s.center + radius * s.direction(k, kSectionAngles);
    if (!field.covers(p)) continue;
    sum += field.at(p);
    ++count;
  }
  return count > 0 ? sum / count : std::numeric_limits<double>::quiet_NaN();
}

double inside_of(const GreyField& field, const CaptureStation& s) {
  const double room = s.radius - 1.5 * field.voxel_mm();
  const double reach = room > 0.3 * s.radius ? room : 0.3 * s.radius;
  return (mean_on_ring(field, s, 0) + 3 * mean_on_ring(field, s, 0.5 * reach) +
          4 * mean_on_ring(field, s, reach)) /
         8;
}

double outside_of(const GreyField& field, const CaptureStation& s) {
  std::vector<double> greys;
  for (const double beyond : {1.7, 2.5, 3.3}) {
    for (int k = 0; k < kSectionAngles; ++k) {
      const Vec3 p =
          s.center + (s.radius + beyond * field.voxel_mm()) * s.direction(k, kSectionAngles);
      if (field.covers(p)) greys.push_back(field.at(p));
    }
  }
  return greys.empty() ? std::numeric_limits<double>::quiet_NaN() : median(std::move(greys));
}

Disc disc_at(const GreyField& field, const CaptureBranch& branch, std::size_t k, double reach) {
  const double voxel = field.voxel_mm();
  const CaptureStation& s = branch.stations[k];
  Disc disc;
  disc.radius = std::max(kDiscRadii * s.radius + kDiscVox * voxel,
                         reach * (kDiscRadii * s.start_radius + kDiscVox * voxel));
  const double step = std::max(voxel, disc.radius / kDiscCells);
  disc.cell_area = step * step;
  const int cells = static_cast<int>(disc.radius / step);

  // Each cell is the mean of the same place in the sections around.
  const std::size_t from = k > kNeighbours ? k - kNeighbours : 0;
  const std::size_t to = std::min(branch.stations.size() - 1, k + kNeighbours);
  for (int i = -cells; i <= cells; ++i) {
    for (int j = -cells; j <= cells; ++j) {
      const Vec2 place = step * Vec2(i, j);
      if (place.norm() > disc.radius) continue;
      double sum = 0;
      int count = 0;
      for (std::size_t n = from; n <= to; ++n) {
        const CaptureStation& o = branch.stations[n];
        const Vec3 p = o.center + place.x() * o.e1 + place.y() * o.e2;
        if (!o.clear || !field.covers(p)) continue;
        sum += field.at(p);
        ++count;
      }
      if (count > 0) disc.cells.push_back({place, sum / count});
    }
  }
  return disc;
}

WallLevels two_levels(std::vector<double> greys) {
  if (greys.empty()) return {0.0, 0.0};
  std::sort(greys.begin(), greys.end());
  std::vector<double> sums{0.0};
  for (const double grey : greys) sums.push_back(sums.back() + grey);
  const auto mean = [&](std::size_t from, std::size_t to) {
    return to > from ? (sums[to] - sums[from]) / static_cast<double>(to - from)
                     : greys[std::min(from, greys.size() - 1)];
  };

  // The threshold halfway between the means of both parts, again and again (Ridler & Calvard:
  // Picture thresholding using an iterative selection method, IEEE Trans. SMC 8, 1978).
  std::size_t cut = greys.size() / 2;
  for (int k = 0; k < 50; ++k) {
    const double threshold = (mean(0, cut) + mean(cut, greys.size())) / 2;
    cut = static_cast<std::size_t>(std::lower_bound(greys.begin(), greys.end(), threshold) -
                                   greys.begin());
  }
  const std::size_t fewest = greys.size() / kFewestPart;
  if (cut < fewest || cut > greys.size() - fewest) return {0.0, 0.0};
  return {mean(cut, greys.size()), mean(0, cut)};
}

}  // namespace angiospline
