#include "recovery/phantoms/phantom.h"

#include <memory>
#include <string>

#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/options.h"
#include "io/centerlines/centerline_export.h"
#include "io/images/image_file.h"
#include "io/images/xray_geometry_file.h"
#include "recovery/phantoms/rings.h"

namespace angiospline::cli {
namespace {

struct Arguments {
  std::string kind;
  std::filesystem::path image;
  std::filesystem::path truth;
  std::filesystem::path truth_tree;
  std::filesystem::path xray;  // views to write; only for rings
  PhantomOptions options;
};

// The rings of two modalities; the truth lies on the grid on which they are grown together.
int write_two_modalities(const Arguments& arguments) {
  const Console console;
  if (arguments.kind != "rings" || !arguments.truth_tree.empty())
    return report_error({ErrorKind::kBadInput, "X-ray views are not made of this phantom", "--xray",
                         arguments.kind, "it is for rings, without --truth-tree"});
  RingsExperimentOptions options;
  if (arguments.options.snr) options.snr = *arguments.options.snr;
  options.seed = arguments.options.seed;

  const auto rings = make_rings_experiment(options);
  if (!rings) return report_error(rings.error());
  if (const auto written = write_image(rings->volume.image, arguments.image); !written)
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

int run(const Arguments& arguments) {
  if (!arguments.xray.empty()) return write_two_modalities(arguments);
  const Console console;
  if (!arguments.truth_tree.empty()) {
    if (const auto target = check_centerline_target(arguments.truth_tree); !target) {
      return report_error(target.error());
    }
  }

  const auto phantom = make_phantom(*phantom_kind(arguments.kind), arguments.options);
  if (!phantom) return report_error(phantom.error());
  if (const auto written = write_image(phantom->image, arguments.image); !written) {
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

}  // namespace

void add_phantom(CommandLine& line) {
  const auto arguments = std::make_shared<Arguments>();
  Arguments& a = *arguments;
  const Command command = line.command("phantom", "synthetic images, seeded and repeatable");
  command.add("KIND", a.kind, "rings, cylinder, potato, bifurcation, bent-vessel or tree")
      .required()
      .one_of({"rings", "cylinder", "potato", "bifurcation", "bent-vessel", "tree"});
  command.add("-o,--output", a.image, "image to write").required();
  command.add("--truth", a.truth, "truth mask to write");
  command.add("--truth-tree", a.truth_tree, "true centerlines to write (.swc, .csv)");
  command.add("--snr", a.options.snr, "signal to noise ratio (default: no noise)").positive();
  command.add("--random-seed", a.options.seed, "of the noise and of the random shapes");
  command.add("--xray", a.xray,
              "rings only: the experiment of two modalities (thesis 7.1); writes this JSON "
              "file of four X-ray views and their images beside it; signal is lost in the "
              "volume and in the views, and --truth has half the volume's voxel edge");
  command.runs([arguments] { return run(*arguments); });
}

}  // namespace angiospline::cli
