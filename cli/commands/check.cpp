#include <memory>
#include <optional>

#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/options.h"
#include "io/export/export_model.h"
#include "io/model/certificate_json.h"
#include "modeling/check/fidelity.h"
#include "modeling/solid/solid.h"
#include "modeling/tree/smooth_centerlines.h"
#include "pipeline/report_json.h"

namespace angiospline::cli {
namespace {

struct Arguments {
  std::filesystem::path model;
  bool json = false;
};

Result<Certificate> certify_any(const AnyModel& any, const std::string& file,
                                const Progress& progress) {
  if (const auto* solid = std::get_if<Solid>(&any)) return certify(*solid, {}, progress);
  if (const auto* model = std::get_if<Model>(&any)) {
    const auto solid = make_solid(model->network);
    if (!solid) return fail(solid.error());
    return certify(*solid, {}, progress);
  }
  return fail({ErrorKind::kBadInput,
               "a triangle mesh has no surfaces to check",
               file,
               {},
               "give a native model, STEP, IGES or BREP"});
}

// A native model against its own tree, smoothed as seeding would.
std::optional<Fidelity> fidelity_of(const AnyModel& any, const Progress& progress) {
  const auto* model = std::get_if<Model>(&any);
  if (model == nullptr || model->tree.branches.empty()) return std::nullopt;
  const auto smoothed = smooth_centerlines(model->tree, {}, progress);
  if (!smoothed) return std::nullopt;
  return measure_fidelity(model->network, *smoothed);
}

int run(const Arguments& arguments) {
  const Console console;
  const auto any = read_any_model(arguments.model, console.progress());
  if (!any) return report_error(any.error());
  const auto certificate = certify_any(*any, arguments.model.string(), console.progress());
  if (!certificate) return report_error(certificate.error());
  const auto fidelity = fidelity_of(*any, console.progress());
  console.finish_line();
  for (const Warning& warning : certificate->warnings) console.warn(warning);
  if (arguments.json) {
    print_json(json_text(*certificate, fidelity));
  } else {
    fmt::print("{}", to_text(*certificate));
    if (fidelity && fidelity->sections > 0) fmt::print("{}\n", to_text(*fidelity));
  }
  return kSuccess;
}

}  // namespace

void add_check(CommandLine& line) {
  const auto arguments = std::make_shared<Arguments>();
  Arguments& a = *arguments;
  const Command command = line.command("check", "measure a model: native, STEP, IGES or BREP");
  command.add("MODEL", a.model, "model file").required();
  add_json_flag(command, a.json);
  command.runs([arguments] { return run(*arguments); });
}

}  // namespace angiospline::cli
