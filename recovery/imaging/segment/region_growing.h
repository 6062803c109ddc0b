// Image to mask: seeded region growing with an adaptive threshold (thesis 4.1).
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "recovery/imaging/image/any_image.h"

namespace angiospline {

enum class Polarity { kBright, kDark };  // vessels against their background

struct GrowOptions {
  // N: the edge of the neighbourhood, in voxels; odd, 3 to 15 (thesis: 5 to 11). Larger is more
  // conservative.
  int neighbourhood_vox = 7;
  // M: how many standard deviations below the mean of the vessel around it a voxel may lie (thesis:
  // 1 to 4). Larger grows further.
  double deviations = 2.0;
  Polarity polarity = Polarity::kBright;
  // Grey value that no vessel is darker than (brighter than, for dark vessels): voxels beyond it
  // are never looked at.
  std::optional<double> background;
  // Typical grey value around the vessels. With it a voxel at least half way from it to mean(S1) is
  // vessel and one less than 0.45 of the way is not, whatever M says: a small M does not starve on
  // smooth images, where the edge lies many deviations below the core, and a large one does not
  // leak. Both bounds follow the brightness of the vessel nearby. Not in the thesis; without it the
  // rule is the thesis's alone.
  std::optional<double> background_level;
  // Typical grey value of the vessels. With it and `background_level`, both not negative, a signal
  // that fades along a thick vessel is followed: where vessel fills much of the neighbourhood and
  // is darker than this, `background` and `background_level` go down with it, to a quarter.
  std::optional<double> vessel_level;
  // Standard deviation of a Gaussian by which the image is smoothed before anything else, as
  // `smoothed` does it, but only near what is looked at; 0: not at all. All grey values meant above
  // and reported are the smoothed ones. Not for growing in several modalities.
  double smoothing_mm = 0;
  // Stops after looking at this many voxels.
  std::optional<std::size_t> max_examined;
  // A seed may lie this many voxels beside the vessel: it moves to the brightest voxel that near.
  int seed_search_vox = 1;
};

// A neck behind which the front found much that is brighter than the neck itself: another vessel
// behind a narrow or dark place, or tissue behind a leak.
struct FrontLeap {
  Voxel neck{0, 0, 0};
  double grey = 0;         // at the neck
  std::size_t before = 0;  // voxels of vessel when the front passed it
  std::size_t opened = 0;  // voxels taken before the front had to go darker than the neck
};

struct GrowReport {
  std::size_t voxels = 0;      // in the mask
  std::size_t examined = 0;    // voxels that were compared with their threshold
  bool limit_reached = false;  // max_examined ended the growing
  std::vector<Voxel> seeds;    // where the growing started, after the search beside each seed
  double threshold_min = 0;    // over all voxels examined: lowest, mean and highest threshold, in
  double threshold_mean = 0;   // grey values of the image; 0 if none was examined
  double threshold_max = 0;
  // Where the front grew suddenly, in the order of growing (from bright to dark): `opened` is at
  // least a quarter of `before`, and 100 voxels.
  std::vector<FrontLeap> leaps;
  double vessel_mean = 0;  // grey values of the mask
  double vessel_deviation = 0;
};

struct Segmentation {
  Mask mask;  // 1 where vessel
  GrowReport report;
};

// The vessel voxels connected to the seeds. A priority queue hands out the brightest neighbour of
// the vessel so far (ties: the one queued first). In the N x N x N voxels around it, S1 are those
// labelled vessel and S2 the N/2 brightest unlabelled ones connected to the candidate, itself among
// them (grown greedily from it, 26-connected). It is vessel if and only if
//     mean(S2) >= mean(S1) - M sigma(S1),
// and then its 26 neighbours are queued; otherwise it is background. Every voxel is compared once.
// Voxels labelled background belong to neither set: counted in S2, as "not labelled as vessel" may
// also be read, a rejected vessel voxel would speak for all its background neighbours, and small M
// would flood the image.
//
// Start: around a seed no voxel is labelled yet, so S1 begins as the voxels of the N x N x N box
// that are on the seed's side of the box's own two-class threshold (Otsu) and connected to the seed
// within the box.
//
// An image with size[2] == 1 is grown in 2-D with 8 neighbours. NaN and infinite voxels are
// background. Errors: no seed; a seed outside the image (named in mm and voxels); no vessel at the
// seed (darker than `background`, not finite, or on the dark side of its neighbourhood);
// kCancelled. Result is the same on every machine. Time: about N*N additions a voxel examined (S1
// is kept as sums over runs of N voxels) plus the queue; memory beyond image and mask: the queue,
// and about 20 bytes a voxel near the vessels.
Result<Segmentation> grow_region(const AnyImage& image, const std::vector<Vec3>& seeds_mm,
                                 const GrowOptions& options = {}, const Progress& progress = {});

// The same for a known pixel type (those of AnyImage).
template <typename T>
Result<Segmentation> grow_region(const Image<T>& image, const std::vector<Vec3>& seeds_mm,
                                 const GrowOptions& options = {}, const Progress& progress = {});

// The lowest value of the upper of the two classes with the largest variance between them (N. Otsu,
// "A threshold selection method from gray-level histograms", 1979), exact: the values are sorted,
// no histogram. Of equal values: that value. Requires at least one value, all finite.
double otsu_threshold(std::vector<double> values);

}  // namespace angiospline
