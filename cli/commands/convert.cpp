#include <filesystem>
#include <memory>
#include <variant>
#include <vector>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/options.h"
#include "io/export/export_model.h"
#include "pipeline/finish_model.h"

namespace angiospline::cli {

namespace {

struct Arguments {
  std::filesystem::path input;
  std::vector<std::filesystem::path> outputs;
  ExportOptions options;
};

int run(const Arguments& arguments) {
  const Console console;
  const std::filesystem::path& input = arguments.input;
  if (auto targets = check_targets(arguments.outputs); !targets) {
    return report_error(targets.error());
  }
  const auto any = read_any_model(input, console.progress());
  if (!any) return report_error(any.error());

  const std::string name = input.stem().string();
  const ExportOptions& options = arguments.options;
  Result<void> written;
  if (const auto* model = std::get_if<Model>(&*any)) {
    const auto report = export_model(*model, arguments.outputs, options, console.progress());
    if (!report) return report_error(report.error());
    for (const Warning& warning : report->warnings) console.warn(warning);
  } else if (const auto* solid = std::get_if<Solid>(&*any)) {
    written = export_solid(*solid, name, arguments.outputs, options, console.progress());
  } else {
    written = export_mesh(std::get<TriangleMesh>(*any), name, arguments.outputs);
  }
  return written ? kSuccess : report_error(written.error());
}

}  // namespace

void add_convert(CommandLine& line) {
  const auto arguments = std::make_shared<Arguments>();
  Arguments& a = *arguments;
  const Command command = line.command("convert", "between model formats");
  command.add("IN", a.input, "model file").required();
  command.add("OUT", a.outputs, "files to write, by suffix").required();
  add_writing_options(command, a.options);
  command.runs([arguments] { return run(*arguments); });
}

}  // namespace angiospline::cli
