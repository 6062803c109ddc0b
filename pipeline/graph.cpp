#include "pipeline/graph.h"

#include <string>
#include <utility>

#include "io/centerlines/centerline_export.h"
#include "io/images/image_file.h"
#include "pipeline/segment_file.h"
#include "recovery/imaging/mask/foreground.h"
#include "recovery/imaging/skeleton/thinning.h"

namespace angiospline {

namespace fs = std::filesystem;

Result<ThinnedFile> thin_file(const fs::path& mask_path, const fs::path& skeleton_path,
                              const ThinFileOptions& options, const Progress& progress) {
  Stopwatch watch;
  const auto mask = read_mask(mask_path, progress);
  if (!mask) return fail(mask.error());
  watch.lap("read");
  const auto skeleton = thin(*mask, {}, progress);
  if (!skeleton) return fail(skeleton.error());
  watch.lap("thin");
  if (auto written = write_image(*skeleton, skeleton_path); !written) return fail(written.error());

  ThinnedFile result;
  result.voxels_before = foreground_offsets(*mask).size();
  result.voxels_after = foreground_offsets(*skeleton).size();
  if (options.topology) {
    result.topology_before = topology_numbers(*mask);
    result.topology_after = topology_numbers(*skeleton);
    watch.lap("count");
  }
  result.seconds = watch.laps();
  return result;
}

Result<GraphedFile> graph_file(const fs::path& skeleton, const std::vector<fs::path>& outputs,
                               const GraphFileOptions& options, const Progress& progress) {
  Stopwatch watch;
  for (const fs::path& path : outputs) {
    if (auto target = check_centerline_target(path); !target) return fail(target.error());
  }

  // One file: the mask itself. Two: its axis, and the mask for the radii.
  const bool is_mask = options.mask.empty();
  auto first = read_mask(skeleton, progress);
  if (!first) return fail(first.error());
  VesselsOptions vessels_options = options.vessels;
  Mask mask;
  if (is_mask) {
    mask = *std::move(first);
  } else {
    vessels_options.skeleton = *std::move(first);
    auto second = read_mask(options.mask, progress);
    if (!second) return fail(second.error());
    mask = *std::move(second);
  }
  watch.lap("read");

  auto vessels = vessels_from_mask(mask, vessels_options, progress);
  if (!vessels) {
    Error error = vessels.error();
    const std::string file = (is_mask ? skeleton : options.mask).string();
    if (error.kind != ErrorKind::kCancelled) {
      error.where = error.where.empty() ? file : file + ": " + error.where;
    }
    return fail(std::move(error));
  }
  watch.lap("graph");
  for (const fs::path& path : outputs) {
    if (auto written = write_centerline_file(path, vessels->tree); !written) {
      return fail(written.error());
    }
  }
  return GraphedFile{*std::move(vessels), watch.laps()};
}

}  // namespace angiospline
