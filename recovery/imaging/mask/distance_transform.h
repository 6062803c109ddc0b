// How far a voxel lies inside the mask.
#pragma once

#include <cstddef>
#include <vector>

#include "recovery/imaging/image/image.h"

namespace angiospline {

// For every foreground voxel the distance in mm from its centre to the centre of the nearest
// background voxel. Exact (to float rounding) with any spacing. What lies outside the image is not
// known and not background, so a vessel cut by the border has no wall there; only if the whole
// image is foreground the outside counts. Kept along runs of foreground: memory and time follow the
// foreground and the rows of the image (after one pass over it), not its voxels. Reference:
// Felzenszwalb and Huttenlocher, "Distance transforms of sampled functions", 2012; here along
// stretches of foreground alone, since the background at a stretch's end hides all beyond it.
class ForegroundDistances {
 public:
  explicit ForegroundDistances(const Mask& mask);

  double at_mm(std::size_t offset) const;  // requires a foreground voxel of the mask
  Image<float> image() const;              // with 0 in the background
  double largest_mm() const;               // 0 if there is no foreground

 private:
  struct Run {
    int begin, end;     // columns
    std::size_t first;  // of values_
  };

  void find_runs(const Mask& mask);
  void transform_across(int axis);  // 1 or 2
  std::size_t row(int y, int z) const {
    return static_cast<std::size_t>(y) +
           static_cast<std::size_t>(grid_.size[1]) * static_cast<std::size_t>(z);
  }

  ImageGrid grid_;
  std::vector<std::size_t> row_begin_;  // first run of each row
  std::vector<Run> runs_;
  std::vector<float> values_;
};

// The distance in mm from each listed foreground voxel's centre to the mask's boundary: the
// distance to the nearest background voxel's centre less half a voxel in that direction. Exact like
// the above but for that half (in a digital tube the mean error is about -0.1 voxel; see
// docs/topology.md); costs a ball of voxels for each place, and no more memory than its offsets.
// Neighbours should follow each other.
std::vector<double> boundary_distances_mm(const Mask& mask,
                                          const std::vector<std::size_t>& offsets);

}  // namespace angiospline
