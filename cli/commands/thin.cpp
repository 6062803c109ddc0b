#include <memory>

#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/options.h"
#include "pipeline/graph.h"
#include "pipeline/report_json.h"

namespace angiospline::cli {
namespace {

struct Arguments {
  std::filesystem::path mask;
  std::filesystem::path skeleton;
  bool json = false;
};

int run(const Arguments& arguments) {
  const Console console;
  const auto thinned = thin_file(arguments.mask, arguments.skeleton, {.topology = arguments.json},
                                 console.progress());
  if (!thinned) return report_error(thinned.error());
  if (arguments.json) print_json(json_text(*thinned));
  console.say(fmt::format("{} voxels thinned to {} -> {}", thinned->voxels_before,
                          thinned->voxels_after, arguments.skeleton.string()));
  return kSuccess;
}

}  // namespace

void add_thin(CommandLine& line) {
  const auto arguments = std::make_shared<Arguments>();
  Arguments& a = *arguments;
  const Command command = line.command("thin", "mask to skeleton, one voxel thick, same topology");
  command.add("MASK", a.mask, "mask image, nonzero inside").required();
  command.add("-o,--output", a.skeleton, "skeleton image to write").required();
  add_json_flag(command, a.json);
  command.runs([arguments] { return run(*arguments); });
}

}  // namespace angiospline::cli
