#include "cli/commands.h"
#include "cli/console.h"
#include "io/centerline_export.h"
#include "io/image_file.h"
#include "recovery/phantom.h"

namespace angiospline::cli {

int run_phantom(const PhantomArguments& arguments) {
  const Console console;
  PhantomOptions options;
  options.snr = arguments.snr;
  options.seed = arguments.random_seed;
  if (!arguments.truth_tree.empty()) {
    if (const auto target = check_centerline_target(arguments.truth_tree); !target) {
      return report_error(target.error());
    }
  }
  const auto phantom = make_phantom(*phantom_kind(arguments.kind), options);
  if (!phantom) return report_error(phantom.error());
  if (const auto written = write_image(phantom->image, arguments.output); !written) {
    return report_error(written.error());
  }
  if (!arguments.truth.empty()) {
    if (const auto written = write_image(phantom->truth, arguments.truth); !written) {
      return report_error(written.error());
    }
  }
  if (!arguments.truth_tree.empty()) {
    if (const auto written = write_centerline_file(arguments.truth_tree, phantom->tree); !written) {
      return report_error(written.error());
    }
  }
  console.say(phantom->description);
  return kSuccess;
}

}  // namespace angiospline::cli
