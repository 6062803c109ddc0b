// Between segmentation and thinning: what makes a mask solid (thesis 7.1.2).
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "recovery/imaging/image/image.h"

namespace angiospline {

// Which neighbours touch a voxel: over a face; a face or an edge; a face, an edge or a corner.
enum class Neighbours { kFaces6 = 6, kEdges18 = 18, kCorners26 = 26 };

// The mask grown by `steps` layers of neighbours. Grows vessels that nearly touch together: use it
// sparingly. Time linear in voxels.
Mask dilate(const Mask& mask, int steps = 1, Neighbours neighbours = Neighbours::kFaces6);

// The mask without its `steps` outer layers; beyond the image counts as foreground.
Mask erode(const Mask& mask, int steps = 1, Neighbours neighbours = Neighbours::kFaces6);

// Dilation then erosion: closes gaps and tunnels up to 2 * steps voxels wide. Contains the mask.
Mask close(const Mask& mask, int steps = 1, Neighbours neighbours = Neighbours::kFaces6);

struct Filled {
  Mask mask;
  std::size_t regions = 0;  // filled
  std::size_t voxels = 0;   // that became foreground
};

// Cavities: 6-connected background that does not reach the border of the image, of at most
// `largest` voxels each.
Filled fill_cavities(Mask mask, std::size_t largest = std::numeric_limits<std::size_t>::max());

// Holes: 4-connected background that is enclosed within one slice, of at most `largest` voxels
// there; slices across each of the three axes, in one pass over the given mask. Closes thin
// tunnels; the limit keeps real loops open. A cavity is enclosed in every slice, so its slices
// count as holes too.
Filled fill_holes(Mask mask, std::size_t largest);

struct Component {
  std::size_t voxels = 0;
  Voxel first{0, 0, 0};  // lowest offset
  bool touches_border = false;
};

// Foreground components: labels 1, 2, ... in order of their lowest offset, 0 in the background.
// Time linear in voxels; memory 4 bytes a voxel for the labels and 12 a run of foreground.
struct Components {
  Image<std::int32_t> labels;
  std::vector<Component> list;  // list[k] has label k + 1
};
Components connected_components(const Mask& mask, Neighbours neighbours);

// How many components; without the label image.
std::size_t component_count(const Mask& mask, Neighbours neighbours);

// Only the component with most voxels (ties: the lowest offset). Empty mask: empty.
Mask largest_component(const Mask& mask, Neighbours neighbours = Neighbours::kCorners26);

// Only components of at least `smallest` voxels.
Mask without_small_components(const Mask& mask, std::size_t smallest,
                              Neighbours neighbours = Neighbours::kCorners26);

// Number of foreground voxels.
std::size_t voxel_count(const Mask& mask);

}  // namespace angiospline
