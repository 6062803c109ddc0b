// Gaussian smoothing of images, spacing honoured.
#pragma once

#include "base/progress.h"
#include "recovery/imaging/image/any_image.h"

namespace angiospline {

// The image convolved with a Gaussian of standard deviation sigma_mm in every direction of the
// world; the kernel is cut at three deviations and normalised, the border value goes on beyond the
// border. Integers are rounded. Voxels that are not finite take no part and stay as they are. Along
// an axis of extent 1 nothing happens; sigma 0 changes nothing.
// Pass the image by std::move to smooth it in place: memory beyond it is then a few slices.
// Requires sigma_mm >= 0. Time: linear in voxels times the kernel's length; parallel over rows, the
// same result on any number of threads.
template <typename T>
Image<T> smoothed(Image<T> image, double sigma_mm);
AnyImage smoothed(AnyImage image, double sigma_mm);

// The voxels from `low` to `high`, both included, of what the image smoothed in float would be, at
// the cost of the box and a margin of three deviations. Whatever the pixel type, equal grey values
// give equal bits: those of smoothed(Image<float>), but for rounding where an image has voxels that
// are not finite. Requires a box within the image.
template <typename T>
Image<float> smoothed_box(const Image<T>& image, const Voxel& low, const Voxel& high,
                          double sigma_mm);
Image<float> smoothed_box(const AnyImage& image, const Voxel& low, const Voxel& high,
                          double sigma_mm);

}  // namespace angiospline
