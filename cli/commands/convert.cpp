#include <filesystem>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/model_stages.h"

namespace angiospline::cli {

int run_convert(const ConvertArguments& arguments) {
  const Console console;
  const std::filesystem::path input = arguments.input;
  const std::vector<std::filesystem::path> paths(arguments.outputs.begin(),
                                                 arguments.outputs.end());
  for (const auto& path : paths) {
    if (const auto target = check_export_target(path); !target) {
      return report_error(target.error());
    }
  }
  const auto any = read_any_model(input, console.progress());
  if (!any) return report_error(any.error());
  ExportOptions options;
  options.step_schema = step_schema(arguments.step_schema);
  Result<void> written;
  if (const auto* model = std::get_if<Model>(&*any)) {
    const auto report = export_model(*model, paths, options, console.progress());
    if (!report) return report_error(report.error());
    for (const Warning& warning : report->warnings) console.warn(warning);
  } else if (const auto* solid = std::get_if<Solid>(&*any)) {
    written = export_solid(*solid, input.stem().string(), paths, options, console.progress());
  } else {
    written = export_mesh(std::get<TriangleMesh>(*any), input.stem().string(), paths);
  }
  return written ? kSuccess : report_error(written.error());
}

}  // namespace angiospline::cli
