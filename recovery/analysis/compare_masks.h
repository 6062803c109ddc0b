// How alike two masks are: voxels, topology, and surfaces in millimetres.
#pragma once

#include <cstddef>
#include <optional>

#include "base/result.h"
#include "recovery/imaging/image/image.h"
#include "recovery/imaging/mask/topology_numbers.h"

namespace angiospline {

// Distances between two surfaces, both ways. A surface is the set of faces between foreground and
// background voxels (the border of the image counts as background); a distance runs from the centre
// of each face of one to the nearest face centre of the other, so that spacing is honoured and two
// masks one voxel apart are one voxel apart.
struct SurfaceDistances {
  double mean_mm = 0;         // average symmetric surface distance: over the faces of both, by area
  double hausdorff95_mm = 0;  // the larger of the two directions' 95th percentiles, by area
  double hausdorff_mm = 0;    // the largest distance of all
};

struct MaskComparison {
  std::size_t truth_voxels = 0;
  std::size_t result_voxels = 0;
  std::size_t both = 0;
  std::size_t missed = 0;  // in the truth only
  std::size_t beyond = 0;  // in the result only
  // The thesis's figure (7.3): voxels in one of the two only, over those of the truth.
  double missed_percent = 0;
  double dice = 1;                 // 2 both / (truth + result); 1 if both are empty
  TopologyNumbers truth_topology;  // 26-connected foreground
  TopologyNumbers result_topology;
  std::optional<SurfaceDistances> surface;  // none if a mask is empty
};

// Compares `result` with `truth`. Error: grids of different size or spacing. Time linear in voxels
// and n log n in faces.
Result<MaskComparison> compare_masks(const Mask& truth, const Mask& result);

// clDice (Shit et al., "clDice", CVPR 2021): the harmonic mean of the share of the result's
// skeleton that lies in the truth and the share of the truth's skeleton that lies in the result. 1
// if all are empty. Requires equal sizes; the caller thins the masks.
double centerline_dice(const Mask& truth, const Mask& truth_skeleton, const Mask& result,
                       const Mask& result_skeleton);

}  // namespace angiospline
