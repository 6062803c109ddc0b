#include <memory>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/options.h"
#include "io/export/export_model.h"
#include "modeling/analysis/compare_surfaces.h"

namespace angiospline::cli {
namespace {

struct Arguments {
  std::filesystem::path a;
  std::filesystem::path b;
  std::optional<double> tolerance_mm;
  bool json = false;
};

using Json = nlohmann::ordered_json;

Json to_json(const DirectedDistance& d) {
  return {{"max_mm", d.max_mm},
          {"mean_mm", d.mean_mm},
          {"rms_mm", d.rms_mm},
          {"worst_mm", {d.worst_mm.x(), d.worst_mm.y(), d.worst_mm.z()}}};
}

Result<TriangleMesh> read_surface(const std::filesystem::path& path, const Progress& progress) {
  auto any = read_any_model(path, progress);
  if (!any) return fail(any.error());
  return triangles_of(*any, progress);
}

int run(const Arguments& arguments) {
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
    const Json json{
        {"max_distance_mm", c->max_distance_mm}, {"mean_distance_mm", c->mean_distance_mm},
        {"rms_distance_mm", c->rms_distance_mm}, {"a_to_b", to_json(c->a_to_b)},
        {"b_to_a", to_json(c->b_to_a)},          {"volume_ratio", c->volume_ratio},
        {"area_ratio", c->area_ratio},           {"same_topology", c->same_topology},
        {"sampling_mm", c->spacing_mm},          {"within_tolerance", within}};
    print_json(json.dump(1, ' '));
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

}  // namespace

void add_compare(CommandLine& line) {
  const auto arguments = std::make_shared<Arguments>();
  Arguments& a = *arguments;
  const Command command = line.command("compare", "geometry regression between two models");
  command.add("A", a.a, "model file").required();
  command.add("B", a.b, "model file").required();
  command
      .add("--tolerance", a.tolerance_mm, "exit 1 when the largest distance is above this, in mm")
      .not_negative();
  add_json_flag(command, a.json);
  command.runs([arguments] { return run(*arguments); });
}

}  // namespace angiospline::cli
