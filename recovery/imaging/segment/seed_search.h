// Where to start growing in an image without seeds: the cores of its brightest tubes.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "recovery/imaging/image/any_image.h"
#include "recovery/imaging/segment/region_growing.h"

namespace angiospline {

struct SeedSearchOptions {
  Polarity polarity = Polarity::kBright;
  // Seeds wanted at most, those of the structures that answer most in all.
  int most = 32;
  // Structures whose core answers less, against the strongest core, are left out: they are other
  // tissue, or vessels that the contrast agent has hardly reached.
  double least_strength = 0.75;
};

// A connected structure that answers to `vesselness`.
struct TubularStructure {
  Vec3 core_mm = Vec3::Zero();  // its strongest voxel: the seed
  double strength = 0;          // the answer there
  double total = 0;             // the sum of its answers
  double tubeness = 0;          // median over the voxels that answer half as strong as the core
  double length_radii = 0;      // from end to end, as the crow flies, in radii of the core's scale
  double border_share = 0;      // of its voxels, along the image's border
};

struct SeedSearch {
  std::vector<TubularStructure> kept;  // most in all first
  std::vector<std::string> left_out;   // one sentence for each reason
};

// The image is averaged to cubic voxels, at most 192 along its longest edge, vesselness is taken
// there, and what answers a quarter as strong as the strongest voxel falls into connected
// structures. Those that sum up to less than 0.03 of the most are not looked at. Each is judged:
//   along the border  more than half of its voxels lie within 4 voxels of a face of the image (of
//                     an axis of more than 16 voxels): a fold of the image, a coil, a table. To
//                     cross the border is no fault.
//   no tube           its tubeness is below 0.4 (a sheet has 0, a ball 0.12, a tube 0.86), or it
//   ends
//                     within the image and is shorter than 4 radii of its core.
//   weak              its core answers less than `least_strength` as strong as the strongest core.
// Where the strongest structure is no tube or lies along the border it is taken away and the rest
// is judged anew, so that one bright spot does not hide the vessels. Nothing kept: nothing tubular
// (an image of one grey value). Error: stopped on request.
Result<SeedSearch> find_seeds(const AnyImage& image, const SeedSearchOptions& options = {},
                              const Progress& progress = {});

// The image find_seeds looks at: averaged over blocks to about cubic voxels, vessels bright (dark
// vessels: negated); blocks without a finite voxel get the lowest mean.
Image<float> seed_grid_image(const AnyImage& image, Polarity polarity);

}  // namespace angiospline
