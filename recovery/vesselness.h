// How much a place looks like a bright tube, and where to start growing from it.
#pragma once

#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "recovery/any_image.h"
#include "recovery/region_growing.h"

namespace angiospline {

struct VesselnessOptions {
  // Radii looked for, in voxels of the grid of `vesselness_at_scales`; the Gaussian of a scale has
  // the deviation radius / sqrt(2), which answers strongest to a tube of that radius.
  std::vector<double> radii_vox = {1.5, 2.5, 4.0, 6.0};
  Polarity polarity = Polarity::kBright;
};

// At each voxel the largest answer over the scales, 0 where nothing is tubular: with the
// eigenvalues |l1| <= |l2| <= |l3| of the scale-normalised Hessian and l2, l3 < 0, it is (1 -
// exp(-2 a^2)) exp(-2 b^2) s, with a = |l2/l3| (tube or sheet), b = |l1| / sqrt(|l2 l3|) (tube or
// blob), s = |l3| the contrast in grey values. Frangi et al., "Multiscale vessel enhancement
// filtering", MICCAI 1998, with the contrast itself in place of its saturating measure: a bright
// vessel answers stronger than a faint one. Voxels should be cubes; memory 16 bytes a voxel.
Result<Image<float>> vesselness(const Image<float>& image, const VesselnessOptions& options = {},
                                const Progress& progress = {});

struct SeedSearchOptions {
  Polarity polarity = Polarity::kBright;
  int most = 8;  // seeds wanted at most
};

// Seeds in the cores of the most tubular structures, best first: the image is averaged to cubic
// voxels of at most kSeedGrid along its longest edge, vesselness is taken there, and of every
// connected structure above a quarter of the strongest answer that is at least a tenth as strong in
// all as the strongest one, the best voxel is a seed. Empty if nothing is tubular (an image of one
// grey value).
Result<std::vector<Vec3>> find_seeds(const AnyImage& image, const SeedSearchOptions& options = {},
                                     const Progress& progress = {});

}  // namespace angiospline
