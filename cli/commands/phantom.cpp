#include "recovery/phantoms/phantom.h"

#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/console.h"
#include "io/centerlines/centerline_export.h"
#include "io/images/image_file.h"
#include "io/images/xray_geometry_file.h"
#include "recovery/phantoms/rings.h"

namespace angiospline::cli {
namespace {

// The rings of two modalities; the truth lies on the grid on which they are grown together.
int write_two_modalities(const PhantomArguments& arguments) {
  const Console console;
  if (arguments.kind != "rings" || !arguments.truth_tree.empty())
    return report_error({ErrorKind::kBadInput, "X-ray views are not made of this phantom", "--xray",
                         arguments.kind, "it is for rings, without --truth-tree"});
  RingsExperimentOptions options;
  if (arguments.snr) options.snr = *arguments.snr;
  options.seed = arguments.random_seed;
  const auto rings = make_rings_experiment(options);
  if (!rings) return report_error(rings.error());
  if (const auto written = write_image(rings->volume.image, arguments.output); !written)
    return report_error(written.error());
  if (const auto written = write_xray_views(rings->views, arguments.xray); !written)
    return report_error(written.error());
  if (!arguments.truth.empty())
    if (const auto written = write_image(rings->truth, arguments.truth); !written)
      return report_error(written.error());
  std::string seeds;
  for (const Vec3& seed : rings_seeds_mm())
    seeds += fmt::format(" --seed {:.4g},{:.4g},{:.4g}", seed.x(), seed.y(), seed.z());
  console.say(fmt::format("{}, SNR {:.3g}; grow with{} --background 400", rings->volume.description,
                          options.snr, seeds));
  return kSuccess;
}

}  // namespace

int run_phantom(const PhantomArguments& arguments) {
  if (!arguments.xray.empty()) return write_two_modalities(arguments);
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
