// Image files to masks: by growing from seeds, in one modality or several, or as they are.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "io/images/image_file.h"
#include "pipeline/stopwatch.h"
#include "recovery/imaging/image/any_image.h"
#include "recovery/imaging/segment/multimodal.h"
#include "recovery/imaging/segment/segment.h"

namespace angiospline {

struct SegmentFileOptions {
  ReadImageOptions reading;
  SegmentOptions segment;
  std::vector<Vec3> seeds_vox;  // further seeds, in voxel indices of the image
};

// An image in memory, segmented (recovery/imaging/segment/segment.h). Errors name `source`.
Result<Segmented> segment_image(const AnyImage& image, const std::string& source,
                                const SegmentFileOptions& options = {},
                                const Progress& progress = {});

// An image, read once, and what grew in it. What reading assumed stands first in the choices of the
// report.
struct SegmentedFile {
  AnyImage image;
  Segmented segmented;
};

// Adds "read" and "segment" to the watch. Errors: those of read_image and segment, which name the
// file. Memory: the image, the mask and what segment needs.
Result<SegmentedFile> segment_file(const std::filesystem::path& image,
                                   const SegmentFileOptions& options, const Progress& progress,
                                   Stopwatch& watch);

struct WrittenMask {
  SegmentReport report;
  StageSeconds seconds;
};

// The same with the mask written to a file. Errors: also those of write_image.
Result<WrittenMask> segment_to_file(const std::filesystem::path& image,
                                    const std::filesystem::path& mask,
                                    const SegmentFileOptions& options = {},
                                    const Progress& progress = {});

struct MultimodalFileOptions {
  SegmentFileOptions image;        // needs a seed and a background; smoothing is not for this
  std::filesystem::path views;     // X-ray views (io/images/xray_geometry_file.h)
  std::optional<double> voxel_mm;  // edge of the mask's voxels; none: half of the image's least
};

struct WrittenMultimodalMask {
  MultimodalReport report;
  StageSeconds seconds;
};

// Grows in the image and all views together (recovery/imaging/segment/multimodal.h) and writes the
// mask. Errors: no seed or no background given; those of reading, growing and writing.
Result<WrittenMultimodalMask> segment_with_views(const std::filesystem::path& image,
                                                 const std::filesystem::path& mask,
                                                 const MultimodalFileOptions& options,
                                                 const Progress& progress = {});

// The mask in an image file: what is not zero is inside. Errors: those of read_image; an empty
// mask.
Result<Mask> read_mask(const std::filesystem::path& path, const Progress& progress = {});

// The inside of the level set in an image file. Errors: likewise.
Result<Mask> read_level_set(const std::filesystem::path& path, const Progress& progress = {});

}  // namespace angiospline
