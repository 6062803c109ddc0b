// The phantom of the thesis's 2-D experiments: a slice through two arteries (7.3.2).
#pragma once

#include <cstdint>

#include "recovery/imaging/image/image.h"

namespace angiospline {

struct SliceArtery {
  Mask truth;  // pixels at least half filled
  Vec3 centre_mm = Vec3::Zero();
  double radius_mm = 0.0;  // of the circle of its area
};

// 64 x 64 pixels of 1 mm, partial volume, contrast 1000 over 200, white Gaussian noise. The
// arteries are as large as the thesis's two carotids (122 and 158 pixels), round but for a few
// percent; a fainter vein runs 4 mm beside the left one, whose edges are the spurious potentials
// there.
struct ArterySlice {
  Image<std::int16_t> image;
  SliceArtery right;  // the patient's: on the left of the image
  SliceArtery left;
};
ArterySlice artery_slice(double snr, std::uint64_t seed);

}  // namespace angiospline
