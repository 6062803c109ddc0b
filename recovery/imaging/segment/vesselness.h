// How much a place looks like a bright tube.
#pragma once

#include <cstdint>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "recovery/imaging/image/image.h"
#include "recovery/imaging/segment/region_growing.h"

namespace angiospline {

struct VesselnessOptions {
  // Radii looked for, in smallest voxel edges, at most 255; the Gaussian of a scale has the
  // deviation radius / sqrt(2), which answers strongest to a tube of that radius.
  std::vector<double> radii_vox = {1.5, 2.5, 4.0, 6.0};
  Polarity polarity = Polarity::kBright;
};

struct Vesselness {
  Image<float> answer;        // in grey values; 0 where nothing is tubular
  Image<float> tubeness;      // 0 to 0.86: the shape alone, at the scale of the answer
  Image<std::uint8_t> scale;  // index of the radius that answers strongest
};

// At each voxel the largest answer over the scales: with the eigenvalues |l1| <= |l2| <= |l3| of
// the scale-normalised Hessian and l2, l3 < 0, the tubeness is (1 - exp(-2 a^2)) exp(-2 b^2) with a
// = |l2/l3| (tube or sheet) and b = |l1| / sqrt(|l2 l3|) (tube or blob), and the answer is tubeness
// times the contrast |l3|. Frangi et al., "Multiscale vessel enhancement filtering", MICCAI 1998,
// with the contrast itself in place of its saturating measure: a bright vessel answers stronger
// than a faint one. Voxels should be cubes; memory 25 bytes a voxel. Error: stopped on request.
Result<Vesselness> vesselness(const Image<float>& image, const VesselnessOptions& options = {},
                              const Progress& progress = {});

}  // namespace angiospline
