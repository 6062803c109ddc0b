#include "pipeline/recover.h"

#include <memory>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/options.h"
#include "cli/outcome.h"
#include "pipeline/report_json.h"

namespace angiospline::cli {
namespace {

struct Arguments {
  std::filesystem::path image;
  std::filesystem::path folder;
  RecoverOptions options;
  bool json = false;
};

int run(const Arguments& arguments) {
  const Console console;
  const auto recovered =
      recover_file(arguments.image, arguments.folder, arguments.options, console.progress());
  if (!recovered) return report_error(recovered.error());
  if (arguments.json) print_json(json_text(*recovered));
  return tell_outcome(recovered->model, recovered->certificate, {arguments.folder.string()},
                      console);
}

}  // namespace

void add_recover(CommandLine& line) {
  const auto arguments = std::make_shared<Arguments>();
  Arguments& a = *arguments;
  a.options.writing.step_in_side_process = true;
  const Command command = line.command("recover", "from an image to a CAD model, every stage kept");
  add_segment_options(command, a.image, a.options.image);
  command.add("-o,--output", a.folder, "folder for the results").required();
  add_vessel_options(command, a.options.vessels);
  command.flag("!--no-fit", a.options.fit,
               "keep the walls of the mask; do not fit them to the image");
  add_refinements_option(command, a.options.fitting.refinements);
  add_json_flag(command, a.json);
  command.runs([arguments] { return run(*arguments); });
}

}  // namespace angiospline::cli
