// The thesis's synthetic images of two modalities (7.1): linked rings in a volume and in X-ray
// views, each with losses of signal where the other has none.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/result.h"
#include "recovery/imaging/segment/multimodal.h"
#include "recovery/phantoms/phantom.h"

namespace angiospline {

struct RingsExperimentOptions {
  double snr = 20;  // of the volume and of the views
  double loss_deg = 12;
  double loss_depth = 0.65;  // share of the signal that is lost
  std::uint64_t seed = 1;    // of the noise
};

struct RingsExperiment {
  Phantom volume;               // 128^3 voxels of 1 mm, hard edges; signal is lost at 0, 45, ...
  std::vector<XrayView> views;  // 256^2 pixels of 0.8 mm, a C-arm at 0, 30, 80 and 145 degrees;
                                // signal is lost at 22.5, 67.5, ...
  Mask truth;  // voxels whose centre lies in a ring, on `finer_grid` of half the volume's voxel
};

// Error: that of make_phantom for options that are not usable.
Result<RingsExperiment> make_rings_experiment(const RingsExperimentOptions& options = {});

// A place on each ring midway between a loss of the volume and one of the views.
std::vector<Vec3> rings_seeds_mm();

enum class RingsImages { kVolume, kViews, kBoth };

// Grown from the seeds in the chosen images, on the grid of the truth, with N = 7 and M = 2, no
// darker than 400 of the volume, at most 400,000 voxels examined.
Result<MultimodalSegmentation> grow_rings(const RingsExperiment& experiment, RingsImages images,
                                          const std::vector<Vec3>& seeds_mm,
                                          const Progress& progress = {});

// How complete the rings of a mask are, and how clean.
struct RingsMeasure {
  std::size_t voxels = 0;
  double found = 0;             // share of the truth's voxels
  double artefact = 0;          // share of the mask's voxels whose centre lies outside the tubes
  double farthest_mm = 0;       // of the mask's voxels beyond the tubes
  std::array<double, 3> arc{};  // of each ring's centerline, the share that is vessel
};
RingsMeasure measure_rings(const RingsExperiment& experiment, const Mask& mask);

}  // namespace angiospline
