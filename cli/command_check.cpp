#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/figures.h"
#include "cli/model_stages.h"
#include "io/certificate_json.h"

namespace angiospline::cli {
namespace {

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

}  // namespace

int run_check(const CheckArguments& arguments) {
  const Console console;
  const auto any = read_any_model(arguments.model, console.progress());
  if (!any) return report_error(any.error());
  const auto certificate = certify_any(*any, arguments.model, console.progress());
  if (!certificate) return report_error(certificate.error());
  console.finish_line();
  for (const std::string& text : certificate->warnings) console.warn(text);
  if (arguments.json) {
    print_json(to_json(*certificate));
  } else {
    fmt::print("{}", to_text(*certificate));
  }
  return kSuccess;
}

}  // namespace angiospline::cli
