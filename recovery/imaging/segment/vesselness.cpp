#include "recovery/imaging/segment/vesselness.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <tbb/parallel_for.h>

#include "recovery/imaging/image/gaussian.h"

namespace angiospline {
namespace {

// Second differences of an image smoothed for one scale, clamped at the border; voxels are taken
// for cubes.
Mat3 differences_at(const Image<float>& f, const Voxel& v) {
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

struct TubeAnswer {
  double answer = 0, tubeness = 0;
};

// The answer for a bright tube; see the header.
TubeAnswer tube_answer(const Mat3& hessian) {
  // A bright tube curves down across itself: the trace is negative, and so is every 2 x 2 block's
  // larger part. Most voxels end here.
  if (hessian.trace() >= 0) return {};
  Eigen::SelfAdjointEigenSolver<Mat3> solver;
  solver.computeDirect(hessian, Eigen::EigenvaluesOnly);
  std::array<double, 3> l{solver.eigenvalues()[0], solver.eigenvalues()[1],
                          solver.eigenvalues()[2]};
  std::sort(l.begin(), l.end(), [](double a, double b) { return std::abs(a) < std::abs(b); });
  if (l[1] >= 0 || l[2] >= 0) return {};
  const double a = l[1] / l[2], b = std::abs(l[0]) / std::sqrt(l[1] * l[2]);
  const double tubeness = (1 - std::exp(-2 * a * a)) * std::exp(-2 * b * b);
  return {tubeness * -l[2], tubeness};
}

}  // namespace

Result<Vesselness> vesselness(const Image<float>& image, const VesselnessOptions& options,
                              const Progress& progress) {
  EXPECTS(options.radii_vox.size() <= 255);
  Vesselness best{Image<float>(image.grid), Image<float>(image.grid),
                  Image<std::uint8_t>(image.grid)};
  const double sign = options.polarity == Polarity::kBright ? 1 : -1;

  for (std::size_t k = 0; k < options.radii_vox.size(); ++k) {
    if (progress.should_stop()) return fail(cancelled("vesselness"));
    progress.at("vesselness",
                static_cast<double>(k) / static_cast<double>(options.radii_vox.size()));

    // A tube of radius r answers most at sigma = r / sqrt(2); sigma^2 makes scales comparable
    // (Lindeberg 1998).
    const double sigma_vox = options.radii_vox[k] / std::sqrt(2.0);
    const Image<float> f = smoothed(image, sigma_vox * image.grid.spacing_mm.minCoeff());
    const double normalise = sign * sigma_vox * sigma_vox;

    tbb::parallel_for(0, image.grid.size[2], [&](int z) {
      for (int y = 0; y < image.grid.size[1]; ++y)
        for (int x = 0; x < image.grid.size[0]; ++x) {
          const Voxel v{x, y, z};
          const TubeAnswer here = tube_answer(normalise * differences_at(f, v));
          if (!(static_cast<float>(here.answer) > best.answer[v])) continue;
          best.answer[v] = static_cast<float>(here.answer);
          best.tubeness[v] = static_cast<float>(here.tubeness);
          best.scale[v] = static_cast<std::uint8_t>(k);
        }
    });
  }
  return best;
}

}  // namespace angiospline
