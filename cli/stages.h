// The stages that several subcommands share, and the timing of each.
#pragma once

#include <chrono>
#include <string>
#include <utility>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "cli/commands.h"
#include "io/images/image_file.h"
#include "recovery/centerlines/vessels_from_mask.h"
#include "recovery/imaging/segment/segment.h"

namespace angiospline::cli {

// Seconds by stage, in the order in which they ended.
class Stopwatch {
 public:
  void lap(std::string stage);
  const std::vector<std::pair<std::string, double>>& laps() const { return laps_; }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
  std::vector<std::pair<std::string, double>> laps_;
};

// How the image of a segmentation is to be read where its files leave that open.
ReadImageOptions reading_of(const SegmentArguments& arguments);

// Reads the image and segments it at the seeds. Errors: those of the verbs, with the file's name.
Result<Segmented> segment_image(const SegmentArguments& arguments, const Progress& progress,
                                Stopwatch& watch);

// The image as a mask: nonzero voxels are inside. Errors: all voxels are zero (names `file`).
Result<Mask> mask_from_image(const AnyImage& image, const std::string& file);

// The inside of a level set: voxels below 0. Errors: there are none (names `file`).
Result<Mask> mask_from_level_set(const AnyImage& image, const std::string& file);

}  // namespace angiospline::cli
