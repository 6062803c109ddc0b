#include "recovery/phantoms/rings.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace angiospline {
namespace {

constexpr double kPi = std::numbers::pi;

// Distance to the wall of the nearest ring's tube; negative inside.
double beyond_rings_mm(const std::vector<Ring>& rings, const Vec3& p) {
  double least = std::numeric_limits<double>::infinity();
  for (const Ring& ring : rings) {
    const Vec3 d = p - ring.centre_mm;
    const double height = d.dot(ring.axis);
    const double across = (d - height * ring.axis).norm() - ring.ring_radius_mm;
    least = std::min(least, std::hypot(height, across) - ring.tube_radius_mm);
  }
  return least;
}

Result<std::vector<XrayView>> make_views(const RingsExperimentOptions& options) {
  PhantomOptions o;
  o.edges = PhantomEdges::kSteps;
  o.loss_deg = options.loss_deg;
  o.loss_depth = options.loss_depth;
  o.loss_phase_deg = 22.5;
  o.background = 0;
  o.vessel = 1000;
  const auto density = make_phantom(PhantomKind::kRings, o);
  if (!density) return fail(density.error());

  Image<float> filled(density->image.grid);
  std::transform(density->image.voxels.begin(), density->image.voxels.end(), filled.voxels.begin(),
                 [](std::int16_t v) { return static_cast<float>(v) / 1000; });

  std::vector<XrayView> views;
  std::uint64_t seed = options.seed;
  for (const double angle : {0.0, 30.0, 80.0, 145.0}) {
    CArm arm;
    arm.angle_deg = angle;
    arm.centre_mm = Vec3::Constant(63.5);
    arm.pixel_mm = 0.8;
    const XrayGeometry geometry = c_arm_geometry(arm);
    views.push_back({geometry, project_volume(filled, geometry, 0.1, options.snr, seed++)});
  }
  return views;
}

}  // namespace

Result<RingsExperiment> make_rings_experiment(const RingsExperimentOptions& options) {
  PhantomOptions o;
  o.edges = PhantomEdges::kSteps;
  o.snr = options.snr;
  o.loss_deg = options.loss_deg;
  o.loss_depth = options.loss_depth;
  o.seed = options.seed;
  auto volume = make_phantom(PhantomKind::kRings, o);
  if (!volume) return fail(volume.error());

  auto views = make_views(options);
  if (!views) return fail(views.error());

  Mask truth(finer_grid(volume->image.grid, 0.5));
  const std::vector<Ring> rings = phantom_rings();
  for (std::size_t i = 0; i < truth.voxels.size(); ++i)
    truth.voxels[i] = beyond_rings_mm(rings, truth.grid.world_mm(truth.grid.voxel(i))) <= 0;
  return RingsExperiment{std::move(*volume), std::move(*views), std::move(truth)};
}

std::vector<Vec3> rings_seeds_mm() {
  std::vector<Vec3> seeds;
  for (const Ring& ring : phantom_rings()) seeds.push_back(ring.at(11.25 * kPi / 180));
  return seeds;
}

Result<MultimodalSegmentation> grow_rings(const RingsExperiment& experiment, RingsImages images,
                                          const std::vector<Vec3>& seeds_mm,
                                          const Progress& progress) {
  Modalities modalities;
  if (images != RingsImages::kViews) {
    const Image<std::int16_t>& volume = experiment.volume.image;
    modalities.volume = Image<float>(volume.grid);
    std::copy(volume.voxels.begin(), volume.voxels.end(), modalities.volume->voxels.begin());
  }
  if (images != RingsImages::kVolume) modalities.views = experiment.views;
  MultimodalOptions options;
  options.volume.background = 400;
  options.max_examined = 400000;
  return grow_region(std::move(modalities), experiment.truth.grid, seeds_mm, options, progress);
}

RingsMeasure measure_rings(const RingsExperiment& experiment, const Mask& mask) {
  EXPECTS(mask.grid.size == experiment.truth.grid.size);
  const std::vector<Ring> rings = phantom_rings();
  RingsMeasure m;
  std::size_t both = 0, truth = 0, artefact = 0;
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) {
    truth += experiment.truth.voxels[i] != 0;
    if (mask.voxels[i] == 0) continue;
    ++m.voxels;
    both += experiment.truth.voxels[i] != 0;
    const double beyond = beyond_rings_mm(rings, mask.grid.world_mm(mask.grid.voxel(i)));
    artefact += beyond > 0;
    m.farthest_mm = std::max(m.farthest_mm, beyond);
  }

  m.found = static_cast<double>(both) / static_cast<double>(truth);
  if (m.voxels > 0) m.artefact = static_cast<double>(artefact) / static_cast<double>(m.voxels);

  // Which degrees of each ring were reached.
  for (std::size_t r = 0; r < rings.size() && r < m.arc.size(); ++r)
    for (int k = 0; k < 360; ++k) {
      const Vec3 at = mask.grid.index_vox(rings[r].at(k * kPi / 180));
      const Voxel v{static_cast<int>(std::lround(at[0])), static_cast<int>(std::lround(at[1])),
                    static_cast<int>(std::lround(at[2]))};
      m.arc[r] += mask.grid.contains(v) && mask[v] != 0 ? 1.0 / 360 : 0.0;
    }
  return m;
}

}  // namespace angiospline
