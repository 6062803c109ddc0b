#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/figures.h"
#include "io/export/export_model.h"
#include "modeling/analysis/compare_surfaces.h"

namespace angiospline::cli {
namespace {

Json to_json(const DirectedDistance& d) {
  return {{"max_mm", d.max_mm},
          {"mean_mm", d.mean_mm},
          {"rms_mm", d.rms_mm},
          {"worst_mm", cli::to_json(d.worst_mm)}};
}

Result<TriangleMesh> read_surface(const std::string& path, const Progress& progress) {
  auto any = read_any_model(path, progress);
  if (!any) return fail(any.error());
  return triangles_of(*any, progress);
}

}  // namespace

int run_compare(const CompareArguments& arguments) {
  const Console console;
  const auto a = read_surface(arguments.a, console.progress());
  if (!a) return report_error(a.error());
  const auto b = read_surface(arguments.b, console.progress());
  if (!b) return report_error(b.error());
  const auto c = compare(*a, *b, {}, console.progress());
  if (!c) return report_error(c.error());
  const bool within = c->same_topology &&
                      (!arguments.tolerance_mm || c->max_distance_mm <= *arguments.tolerance_mm);
  if (arguments.json) {
    print_json({{"max_distance_mm", c->max_distance_mm},
                {"mean_distance_mm", c->mean_distance_mm},
                {"rms_distance_mm", c->rms_distance_mm},
                {"a_to_b", to_json(c->a_to_b)},
                {"b_to_a", to_json(c->b_to_a)},
                {"volume_ratio", c->volume_ratio},
                {"area_ratio", c->area_ratio},
                {"same_topology", c->same_topology},
                {"sampling_mm", c->spacing_mm},
                {"within_tolerance", within}});
  } else {
    fmt::print("largest distance  {:.6g} mm (sampled every {:.3g} mm)\n", c->max_distance_mm,
               c->spacing_mm);
    fmt::print("mean distance     {:.6g} mm\n", c->mean_distance_mm);
    fmt::print("rms distance      {:.6g} mm\n", c->rms_distance_mm);
    fmt::print("volume B / A      {:.9g}\n", c->volume_ratio);
    fmt::print("area B / A        {:.9g}\n", c->area_ratio);
    fmt::print("same topology     {}\n", c->same_topology ? "yes" : "no");
  }
  return within ? kSuccess : kFailure;
}

}  // namespace angiospline::cli
