#include "recovery/vesselness.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include <Eigen/Eigenvalues>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "recovery/gaussian.h"
#include "recovery/morphology.h"

namespace angiospline {
namespace {

constexpr double kSeedGrid = 192;

// Second differences of an image smoothed for one scale, clamped at the border.
Mat3 hessian_at(const Image<float>& f, const Voxel& v) {
  const auto at = [&](int dx, int dy, int dz) {
    const Voxel n{std::clamp(v[0] + dx, 0, f.grid.size[0] - 1),
                  std::clamp(v[1] + dy, 0, f.grid.size[1] - 1),
                  std::clamp(v[2] + dz, 0, f.grid.size[2] - 1)};
    return static_cast<double>(f[n]);
  };
  const double c = at(0, 0, 0);
  Mat3 h;
  h(0, 0) = at(1, 0, 0) - 2 * c + at(-1, 0, 0);
  h(1, 1) = at(0, 1, 0) - 2 * c + at(0, -1, 0);
  h(2, 2) = at(0, 0, 1) - 2 * c + at(0, 0, -1);
  h(0, 1) = h(1, 0) = (at(1, 1, 0) - at(1, -1, 0) - at(-1, 1, 0) + at(-1, -1, 0)) / 4;
  h(0, 2) = h(2, 0) = (at(1, 0, 1) - at(1, 0, -1) - at(-1, 0, 1) + at(-1, 0, -1)) / 4;
  h(1, 2) = h(2, 1) = (at(0, 1, 1) - at(0, 1, -1) - at(0, -1, 1) + at(0, -1, -1)) / 4;
  return h;
}

// The answer for a bright tube; see the header.
double tube_answer(const Mat3& hessian) {
  // A bright tube curves down across itself: the trace is negative, and so is every 2 x 2 block's
  // larger part. Most voxels end here.
  if (hessian.trace() >= 0) return 0;
  Eigen::SelfAdjointEigenSolver<Mat3> solver;
  solver.computeDirect(hessian, Eigen::EigenvaluesOnly);
  std::array<double, 3> l{solver.eigenvalues()[0], solver.eigenvalues()[1],
                          solver.eigenvalues()[2]};
  std::sort(l.begin(), l.end(), [](double a, double b) { return std::abs(a) < std::abs(b); });
  if (l[1] >= 0 || l[2] >= 0) return 0;
  const double a = l[1] / l[2], b = std::abs(l[0]) / std::sqrt(l[1] * l[2]);
  return (1 - std::exp(-2 * a * a)) * std::exp(-2 * b * b) * -l[2];
}

// The image averaged over blocks to about cubic voxels, vessels bright, the sign of the polarity
// taken in; blocks without a finite voxel get the lowest mean.
Image<float> reduced(const AnyImage& image, Polarity polarity) {
  const ImageGrid& grid = grid_of(image);
  Vec3 extent;
  for (int i = 0; i < 3; ++i)
    extent[i] = grid.size[static_cast<std::size_t>(i)] * grid.spacing_mm[i];
  const double cell = std::max(extent.maxCoeff() / kSeedGrid, grid.spacing_mm.minCoeff());
  std::array<int, 3> block;
  ImageGrid coarse = grid;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    block[i] = std::max(1, static_cast<int>(std::lround(cell / grid.spacing_mm[k])));
    coarse.size[i] = std::max(1, grid.size[i] / block[i]);
    coarse.spacing_mm[k] = grid.spacing_mm[k] * block[i];
  }
  coarse.origin_mm =
      grid.world_mm(Vec3((block[0] - 1) / 2.0, (block[1] - 1) / 2.0, (block[2] - 1) / 2.0));
  Image<float> out(coarse);
  const double sign = polarity == Polarity::kBright ? 1 : -1;
  std::visit(
      [&](const auto& in) {
        tbb::parallel_for(0, coarse.size[2], [&](int z) {
          for (int y = 0; y < coarse.size[1]; ++y)
            for (int x = 0; x < coarse.size[0]; ++x) {
              double sum = 0;
              int count = 0;
              for (int c = 0; c < block[2]; ++c)
                for (int b = 0; b < block[1]; ++b)
                  for (int a = 0; a < block[0]; ++a) {
                    const double v = static_cast<double>(
                        in[{x * block[0] + a, y * block[1] + b, z * block[2] + c}]);
                    if (std::isfinite(v)) sum += v, ++count;
                  }
              out[{x, y, z}] = count > 0 ? static_cast<float>(sign * sum / count)
                                         : std::numeric_limits<float>::quiet_NaN();
            }
        });
      },
      image);
  float lowest = 0;
  bool any = false;
  for (const float v : out.voxels)
    if (std::isfinite(v)) lowest = any ? std::min(lowest, v) : v, any = true;
  for (float& v : out.voxels)
    if (!std::isfinite(v)) v = lowest;
  return out;
}

}  // namespace

Result<Image<float>> vesselness(const Image<float>& image, const VesselnessOptions& options,
                                const Progress& progress) {
  Image<float> best(image.grid);
  const double sign = options.polarity == Polarity::kBright ? 1 : -1;
  for (std::size_t k = 0; k < options.radii_vox.size(); ++k) {
    if (progress.should_stop()) return fail(cancelled("vesselness"));
    progress.at("vesselness",
                static_cast<double>(k) / static_cast<double>(options.radii_vox.size()));
    const double sigma_vox = options.radii_vox[k] / std::sqrt(2.0);
    const Image<float> f = smoothed(image, sigma_vox * image.grid.spacing_mm.minCoeff());
    const double normalise = sign * sigma_vox * sigma_vox;
    tbb::parallel_for(0, image.grid.size[2], [&](int z) {
      for (int y = 0; y < image.grid.size[1]; ++y)
        for (int x = 0; x < image.grid.size[0]; ++x) {
          const double answer = tube_answer(normalise * hessian_at(f, {x, y, z}));
          float& here = best[{x, y, z}];
          here = std::max(here, static_cast<float>(answer));
        }
    });
  }
  return best;
}

Result<std::vector<Vec3>> find_seeds(const AnyImage& image, const SeedSearchOptions& options,
                                     const Progress& progress) {
  const Image<float> small = reduced(image, options.polarity);
  Result<Image<float>> answer = vesselness(small, {}, progress);
  if (!answer) return fail(answer.error());
  // A border answers to what lies beyond it, which is not known.
  for (std::size_t i = 0; i < answer->voxels.size(); ++i) {
    const Voxel v = small.grid.voxel(i);
    for (std::size_t k = 0; k < 3; ++k)
      if (v[k] < 2 || v[k] > small.grid.size[k] - 3) answer->voxels[i] = 0;
  }
  const float strongest = *std::max_element(answer->voxels.begin(), answer->voxels.end());
  if (!(strongest > 0)) return std::vector<Vec3>{};
  Mask strong(small.grid);
  for (std::size_t i = 0; i < strong.voxels.size(); ++i)
    strong.voxels[i] = answer->voxels[i] >= 0.25F * strongest;
  const Components parts = connected_components(strong, Neighbours::kCorners26);
  struct Part {
    double total = 0;
    std::size_t best = 0;
  };
  std::vector<Part> found(parts.list.size());
  for (std::size_t i = 0; i < strong.voxels.size(); ++i) {
    if (parts.labels.voxels[i] == 0) continue;
    Part& p = found[static_cast<std::size_t>(parts.labels.voxels[i] - 1)];
    if (p.total == 0 || answer->voxels[i] > answer->voxels[p.best]) p.best = i;
    p.total += static_cast<double>(answer->voxels[i]);
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const Part& a, const Part& b) { return a.total > b.total; });
  std::vector<Vec3> seeds;
  for (const Part& p : found)
    if (std::ssize(seeds) < options.most && p.total >= 0.03 * found.front().total)
      seeds.push_back(small.grid.world_mm(small.grid.voxel(p.best)));
  return seeds;
}

}  // namespace angiospline
