// How far a voxel lies inside the mask.
#pragma once

#include <cstddef>
#include <vector>

#include "recovery/image.h"

namespace angiospline {

// At each foreground voxel the distance in mm from its centre to the centre of the nearest
// background voxel; 0 in the background. Exact (to float rounding) with any spacing. What lies
// outside the image is not known and not background, so a vessel cut by the border has no wall
// there; only if the whole image is foreground the outside counts. Linear time, 4 bytes a voxel.
// Reference: Felzenszwalb and Huttenlocher, "Distance transforms of sampled functions", 2012.
Image<float> distances_to_background_mm(const Mask& mask);

// The distance in mm from each listed foreground voxel's centre to the mask's boundary: the
// distance to the nearest background voxel's centre less half a voxel in that direction. Exact like
// the above but for that half (in a digital tube the mean error is about -0.1 voxel; see
// docs/topology.md); costs a ball of voxels for each place, and no more memory than its offsets.
// Neighbours should follow each other.
std::vector<double> boundary_distances_mm(const Mask& mask,
                                          const std::vector<std::size_t>& offsets);

}  // namespace angiospline
