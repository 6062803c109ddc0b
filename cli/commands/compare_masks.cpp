#include "recovery/analysis/compare_masks.h"

#include <memory>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/options.h"
#include "pipeline/segment_file.h"
#include "recovery/analysis/compare_centerlines.h"
#include "recovery/centerlines/vessels_from_mask.h"

namespace angiospline::cli {
namespace {

struct Arguments {
  std::filesystem::path truth;
  std::filesystem::path result;
  bool level_set = false;   // `truth` is a level set, negative inside
  bool within_box = false;  // what lies beyond the bounding box of the truth does not count
  bool no_centerlines = false;
  bool json = false;
};

struct CenterlineFigures {
  CenterlineOverlap overlap;
  double dice = 1;  // clDice
};

Result<CenterlineFigures> compare_centerlines(const Mask& truth, const Mask& result,
                                              const Progress& progress) {
  const auto true_vessels = vessels_from_mask(truth, {}, progress);
  if (!true_vessels) return fail(true_vessels.error());
  const auto vessels = vessels_from_mask(result, {}, progress);
  if (!vessels) return fail(vessels.error());
  return CenterlineFigures{
      centerline_overlap(true_vessels->tree, vessels->tree),
      centerline_dice(truth, true_vessels->skeleton, result, vessels->skeleton)};
}

// The part of the result within the bounding box of the truth.
void cut_to(const Mask& truth, Mask& result) {
  Voxel low = truth.grid.size, high{-1, -1, -1};
  for (std::size_t i = 0; i < truth.voxels.size(); ++i) {
    if (truth.voxels[i] == 0) continue;
    const Voxel v = truth.grid.voxel(i);
    for (std::size_t k = 0; k < 3; ++k)
      low[k] = std::min(low[k], v[k]), high[k] = std::max(high[k], v[k]);
  }
  for (std::size_t i = 0; i < result.voxels.size(); ++i) {
    const Voxel v = result.grid.voxel(i);
    for (std::size_t k = 0; k < 3; ++k)
      if (v[k] < low[k] || v[k] > high[k]) result.voxels[i] = 0;
  }
}

bool lie_alike(const ImageGrid& a, const ImageGrid& b) {
  const double voxel = a.spacing_mm.minCoeff();
  return (a.origin_mm - b.origin_mm).norm() < 0.01 * voxel &&
         a.direction.isApprox(b.direction, 1e-4);
}

using Json = nlohmann::ordered_json;

Json to_json(const TopologyNumbers& n) {
  return {{"components", n.components}, {"cavities", n.cavities}, {"cycles", n.cycles}};
}

Json to_json(const MaskComparison& c, const std::optional<CenterlineFigures>& lines) {
  Json json{{"truth_voxels", c.truth_voxels},     {"result_voxels", c.result_voxels},
            {"missed_voxels", c.missed},          {"beyond_voxels", c.beyond},
            {"missed_percent", c.missed_percent}, {"dice", c.dice},
            {"truth", to_json(c.truth_topology)}, {"result", to_json(c.result_topology)}};
  if (c.surface) {
    json["assd_mm"] = c.surface->mean_mm;
    json["hausdorff95_mm"] = c.surface->hausdorff95_mm;
    json["hausdorff_mm"] = c.surface->hausdorff_mm;
  }
  if (lines) {
    json["centerline_dice"] = lines->dice;
    json["centerline"] = {{"overlap", lines->overlap.overlap},
                          {"found", lines->overlap.found},
                          {"correct", lines->overlap.correct},
                          {"offset_mm", lines->overlap.offset_mm},
                          {"truth_length_mm", lines->overlap.truth_length_mm},
                          {"result_length_mm", lines->overlap.result_length_mm}};
  }
  return json;
}

void print_table(const MaskComparison& c, const std::optional<CenterlineFigures>& lines) {
  fmt::print("voxels             {} true, {} found\n", c.truth_voxels, c.result_voxels);
  fmt::print("missed, beyond     {}, {} ({:.2f} % of the truth)\n", c.missed, c.beyond,
             c.missed_percent);
  fmt::print("Dice               {:.4f}\n", c.dice);
  if (c.surface) {
    fmt::print("surface distance   {:.4g} mm in the mean, {:.4g} mm for 95 %, {:.4g} mm at most\n",
               c.surface->mean_mm, c.surface->hausdorff95_mm, c.surface->hausdorff_mm);
  }
  for (const auto& [name, n] :
       {std::pair("truth ", c.truth_topology), {"result", c.result_topology}})
    fmt::print("{}             {} components, {} cavities, {} loops\n", name, n.components,
               n.cavities, n.cycles);
  if (!lines) return;
  fmt::print("clDice             {:.4f}\n", lines->dice);
  fmt::print("centerline overlap {:.4f} ({:.2f} % found, {:.2f} % correct), {:.3g} mm apart\n",
             lines->overlap.overlap, 100 * lines->overlap.found, 100 * lines->overlap.correct,
             lines->overlap.offset_mm);
}

int run(const Arguments& arguments) {
  const Console console;
  const auto truth = arguments.level_set ? read_level_set(arguments.truth, console.progress())
                                         : read_mask(arguments.truth, console.progress());
  if (!truth) return report_error(truth.error());
  auto result = read_mask(arguments.result, console.progress());
  if (!result) return report_error(result.error());
  if (arguments.within_box && truth->grid.size == result->grid.size) cut_to(*truth, *result);
  const auto compared = compare_masks(*truth, *result);
  if (!compared) return report_error(compared.error());
  const bool placed_alike = lie_alike(truth->grid, result->grid);
  if (!placed_alike)
    console.warn({WarningCode::kMasksPlacedApart,
                  "the masks' origins or directions differ; they are compared voxel by voxel"});
  result->grid = truth->grid;
  std::optional<CenterlineFigures> lines;
  if (!arguments.no_centerlines && compared->result_voxels > 0) {
    auto figures = compare_centerlines(*truth, *result, console.progress());
    if (!figures) return report_error(figures.error());
    lines = *figures;
  }
  if (arguments.json) {
    Json json = to_json(*compared, lines);
    json["same_place"] = placed_alike;
    print_json(json.dump(1, ' '));
  } else {
    console.finish_line();
    print_table(*compared, lines);
  }
  return kSuccess;
}

}  // namespace

void add_compare_masks(CommandLine& line) {
  const auto arguments = std::make_shared<Arguments>();
  Arguments& a = *arguments;
  const Command command = line.command(
      "compare-masks", "how alike two masks are: voxels, surfaces, topology, centerlines");
  command.add("TRUTH", a.truth, "mask image, nonzero inside").required();
  command.add("RESULT", a.result, "mask image on the same grid").required();
  command.flag("--level-set", a.level_set, "TRUTH is a level set, negative inside");
  command.flag("--within-box", a.within_box,
               "leave out what lies beyond the bounding box of TRUTH");
  command.flag("--no-centerlines", a.no_centerlines, "do not thin the masks");
  add_json_flag(command, a.json);
  command.runs([arguments] { return run(*arguments); });
}

}  // namespace angiospline::cli
