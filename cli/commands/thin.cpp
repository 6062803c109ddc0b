#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/figures.h"
#include "recovery/imaging/mask/topology_numbers.h"
#include "recovery/imaging/skeleton/thinning.h"

namespace angiospline::cli {
namespace {

std::size_t count(const Mask& mask) { return foreground_offsets(mask).size(); }

}  // namespace

int run_thin(const ThinArguments& arguments) {
  const Console console;
  Stopwatch watch;
  const auto file = read_image(arguments.mask, {}, console.progress());
  if (!file) return report_error(file.error());
  const auto mask = mask_from_image(file->image, arguments.mask);
  if (!mask) return report_error(mask.error());
  watch.lap("read");
  const auto skeleton = thin(*mask, {}, console.progress());
  if (!skeleton) return report_error(skeleton.error());
  watch.lap("thin");
  if (const auto written = write_image(*skeleton, arguments.output); !written) {
    return report_error(written.error());
  }
  const std::size_t before = count(*mask);
  const std::size_t after = count(*skeleton);
  if (arguments.json) {
    const auto topology_json = [](const TopologyNumbers& numbers) {
      return Json{{"components", numbers.components},
                  {"cavities", numbers.cavities},
                  {"cycles", numbers.cycles}};
    };
    Json json{{"voxels_in", before},
              {"voxels_out", after},
              {"before", topology_json(topology_numbers(*mask))},
              {"after", topology_json(topology_numbers(*skeleton))}};
    watch.lap("count");
    json["seconds"] = seconds_json(watch);
    print_json(json);
  }
  console.say(fmt::format("{} voxels thinned to {} -> {}", before, after, arguments.output));
  return kSuccess;
}

}  // namespace angiospline::cli
