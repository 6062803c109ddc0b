// Image to mask in one call: smoothing, seeds and parameters where none are given, region growing,
// and the clean-up that thinning needs.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "base/warning.h"
#include "recovery/imaging/image/any_image.h"
#include "recovery/imaging/mask/swelling.h"
#include "recovery/imaging/segment/region_growing.h"

namespace angiospline {

struct SegmentOptions {
  std::vector<Vec3> seeds_mm;  // none: the cores of the most tubular structures
  Polarity polarity = Polarity::kBright;
  std::optional<int> neighbourhood_vox;  // N; none: from the vessel's radius at the seeds
  std::optional<double> deviations;      // M; none: from the contrast to noise at the seeds
  std::optional<double> background;      // none: from the grey values around the seeds
  std::optional<std::size_t> max_examined;
  // Gaussian smoothing before growing, its deviation in the smallest voxel edge. Noise is the enemy
  // of topology: 0.8 removes the tunnels of white noise and moves edges by less than a tenth voxel
  // on tubes of 3 voxels radius.
  double smoothing_vox = 0.8;
  // Holes within a slice of at most this many voxels are filled; cavities always are.
  std::size_t largest_hole_vox = 6;
  // Leaves out what the front reached through a neck and is so much thicker than the vessel that it
  // is probably tissue (see Swelling); otherwise it is only reported.
  bool cut_swellings = false;
};

// Grey values around a seed.
struct SeedLevels {
  double vessel = 0, vessel_deviation = 0;          // of the vessel's inside
  double background = 0, background_deviation = 0;  // median, and 1.4826 median absolute deviation
  double radius_mm = 0;                             // of a tube with the vessel's volume; rough
};

struct SegmentReport {
  GrowReport grown;
  std::vector<Vec3> seeds_mm;
  bool seeds_found = false;          // automatically
  std::optional<SeedLevels> levels;  // medians over the seeds; none if nothing had to be chosen
  int neighbourhood_vox = 0;         // as used, and so below
  double deviations = 0;
  double background = 0;
  std::size_t filled_voxels = 0;
  std::size_t components = 0;        // 26-connected
  std::optional<Swelling> swelling;  // behind the neck where the front found most
  std::vector<std::string> choices;  // what was chosen, and from what: one sentence each
  std::vector<Warning> warnings;     // leaks, limits
};

struct Segmented {
  Mask mask;
  SegmentReport report;
};

// The vessels at the seeds. The image is smoothed only where it is looked at; the grey values of
// the report are those after smoothing.
//
// Choices. Around each seed the smallest cube with more background than vessel in it is split in
// two classes (Otsu); inside and outside give the levels v and b, their deviations and the radius
// r.
//   N          odd, 2 r + 1 voxels, 5 to 11
//   M          2, or less: v - M sigma_v stays above the middle of v and b; at least 1
//   background b + 2 sigma_b, within 0.2 to 0.4 of the way from b to v
//              In case the mask leaks (more than 20 loops), the threshold rises step by step until
//              it does not, first to the neck behind which the front grew suddenly; found seeds
//              that are darker are dropped.
//   swelling   Where the front found most behind a neck darker than the vessel, and more than 2.5
//              times as thick, a warning says so; `cut_swellings` leaves it out.
//   level      b is the `background_level` of GrowOptions
// Errors: those of grow_region; a given seed around which no vessel stands out (unless N, M and the
// background are all given); no seed given and nothing tubular found.
Result<Segmented> segment(const AnyImage& image, const SegmentOptions& options = {},
                          const Progress& progress = {});

}  // namespace angiospline
