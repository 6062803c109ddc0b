// Mask files to skeletons, and those to centerlines.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "pipeline/stopwatch.h"
#include "recovery/centerlines/vessels_from_mask.h"
#include "recovery/imaging/mask/topology_numbers.h"

namespace angiospline {

struct ThinFileOptions {
  bool topology = false;  // count components, cavities and loops before and after
};

struct ThinnedFile {
  std::size_t voxels_before = 0;
  std::size_t voxels_after = 0;
  std::optional<TopologyNumbers> topology_before;  // where asked for
  std::optional<TopologyNumbers> topology_after;
  StageSeconds seconds;
};

// Thins the mask in an image file (recovery/imaging/skeleton/thinning.h) and writes the skeleton.
// Errors: those of reading, thinning and writing.
Result<ThinnedFile> thin_file(const std::filesystem::path& mask,
                              const std::filesystem::path& skeleton,
                              const ThinFileOptions& options = {}, const Progress& progress = {});

struct GraphFileOptions {
  std::filesystem::path mask;  // that the skeleton came from, for the radii; empty: the first file
                               // is the mask itself and is thinned first
  VesselsOptions vessels;      // its skeleton is that of the file
};

struct GraphedFile {
  Vessels vessels;
  StageSeconds seconds;
};

// The centerlines of a skeleton (or of a mask), with radii, written to every output by its suffix:
// .swc .csv .graphml .vtp. Outputs are checked first. Errors: those of reading, vessels_from_mask
// and writing; they name the file.
Result<GraphedFile> graph_file(const std::filesystem::path& skeleton,
                               const std::vector<std::filesystem::path>& outputs,
                               const GraphFileOptions& options = {}, const Progress& progress = {});

}  // namespace angiospline
