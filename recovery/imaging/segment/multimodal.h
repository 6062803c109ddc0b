// Region growing in a volume image and X-ray projections together (thesis 4.1.1).
#pragma once

#include <optional>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "recovery/imaging/image/xray.h"
#include "recovery/imaging/segment/region_growing.h"

namespace angiospline {

// Registered images of one patient. At least one of both kinds; a volume alone or views alone are
// legal, for comparison.
struct Modalities {
  std::optional<Image<float>> volume;
  std::vector<XrayView> views;
};

struct MultimodalOptions {
  GrowOptions volume;      // N, M, polarity, background threshold of the volume
  GrowOptions projection;  // of each view, in two dimensions
  // Voxels examined in the world at most.
  std::optional<std::size_t> max_examined;
};

struct MultimodalReport {
  std::size_t voxels = 0;  // of the world grid, labelled vessel
  std::size_t examined = 0;
  std::size_t by_volume = 0;  // labelled because of the volume alone,
  std::size_t by_views = 0;   // because of the views alone,
  std::size_t by_both = 0;    // because of both
  bool limit_reached = false;
};

struct MultimodalSegmentation {
  Mask mask;              // on the world grid
  Modalities modalities;  // with the grey values that were filled in
  MultimodalReport report;
};

// A grid over the same field of view with cubic voxels of this edge; requires spacing_mm > 0.
ImageGrid finer_grid(const ImageGrid& grid, double spacing_mm);

// The vessels at the seeds, on `world`, whose voxels should be smaller than those of all images. A
// priority queue hands out the candidate that is brightest in the volume (without a volume: whose
// darkest view is brightest). The candidate is projected into each image, and there the rule of
// grow_region decides with that image's own labels, a pixel already labelled vessel being vessel.
// It is vessel if the volume says so or if all views say so. An image that said otherwise takes
// there the grey value that its image of the candidate's parent has, and the label, so that growing
// goes on. Voxels beyond the volume's background threshold are never looked at: so the volume
// guides the views. Candidates outside a view's detector are not vessel in it. Errors: those of
// grow_region for a seed in any image; no image at all.
Result<MultimodalSegmentation> grow_region(Modalities modalities, const ImageGrid& world,
                                           const std::vector<Vec3>& seeds_mm,
                                           const MultimodalOptions& options = {},
                                           const Progress& progress = {});

}  // namespace angiospline
