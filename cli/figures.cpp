#include "cli/figures.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace angiospline::cli {
namespace {

std::vector<int> degrees(const CenterlineTree& tree) {
  std::vector<int> degree;
  for (const auto& branches : branches_at_nodes(tree)) {
    degree.push_back(static_cast<int>(branches.size()));
  }
  return degree;
}

int junction_count(const CenterlineTree& tree) {
  const std::vector<int> degree = degrees(tree);
  return static_cast<int>(
      std::count_if(degree.begin(), degree.end(), [](int d) { return d >= 3; }));
}

}  // namespace

Json to_json(const Vec3& v) { return Json::array({v.x(), v.y(), v.z()}); }

Json seconds_json(const Stopwatch& watch) {
  Json json = Json::object();
  for (const auto& [stage, seconds] : watch.laps()) json[stage] = seconds;
  return json;
}

Json segmentation_json(const SegmentReport& report) {
  Json seeds = Json::array();
  for (const Vec3& seed : report.seeds_mm) seeds.push_back(to_json(seed));
  return {{"voxels", report.grown.voxels + report.filled_voxels},
          {"examined", report.grown.examined},
          {"filled", report.filled_voxels},
          {"components", report.components},
          {"limit_reached", report.grown.limit_reached},
          {"neighborhood", report.neighbourhood_vox},
          {"deviations", report.deviations},
          {"background", report.background},
          {"threshold",
           {{"min", report.grown.threshold_min},
            {"mean", report.grown.threshold_mean},
            {"max", report.grown.threshold_max}}},
          {"vessel_mean", report.grown.vessel_mean},
          {"vessel_deviation", report.grown.vessel_deviation},
          {"seeds_mm", seeds},
          {"seeds_found", report.seeds_found},
          {"assumptions", report.choices},
          {"warnings", texts_of(report.warnings)},
          {"warning_codes", code_names_of(report.warnings)}};
}

Json graph_json(const CenterlineTree& tree) {
  const std::vector<int> degree = degrees(tree);
  Json nodes = Json::array();
  for (std::size_t n = 0; n < tree.nodes.size(); ++n) {
    nodes.push_back({{"id", tree.nodes[n].name},
                     {"kind", degree[n] >= 3 ? "junction" : "end"},
                     {"position_mm", to_json(tree.nodes[n].position_mm)},
                     {"degree", degree[n]}});
  }
  Json branches = Json::array();
  for (const CenterlineBranch& branch : tree.branches) {
    branches.push_back({{"id", branch.name},
                        {"from", tree.nodes[static_cast<std::size_t>(branch.from)].name},
                        {"to", tree.nodes[static_cast<std::size_t>(branch.to)].name},
                        {"length_mm", length_mm(branch)},
                        {"mean_radius_mm", branch.radii_mm.mean()},
                        {"min_radius_mm", branch.radii_mm.minCoeff()}});
  }
  return {{"nodes", nodes},
          {"branches", branches},
          {"components", component_count(tree)},
          {"cycles", cycle_count(tree)},
          {"assumptions", tree.assumptions}};
}

Json contacts_json(const Vessels& vessels) {
  Json contacts = Json::array();
  for (const MaskContact& contact : vessels.contacts)
    contacts.push_back({{"kind", name_of(contact.kind)},
                        {"position_mm", to_json(contact.at_mm)},
                        {"radii_mm", {contact.a.radius_mm, contact.b.radius_mm}},
                        {"distance_mm", contact.distance_mm},
                        {"cut", vessels.contacts_cut > 0}});
  return contacts;
}

Json model_json(const Model& model) {
  Json failed = Json::array();
  for (const FailedPart& part : model.failed)
    failed.push_back({{"name", part.name}, {"why", part.why}});
  return {{"branches", model.tree.branches.size()},
          {"junctions", junction_count(model.tree)},
          {"loops", cycle_count(model.tree)},
          {"components", component_count(model.tree)},
          {"patches", model.network.patches.size()},
          {"failed", failed},
          {"assumptions", model.assumptions},
          {"warnings", texts_of(model.warnings)},
          {"warning_codes", code_names_of(model.warnings)}};
}

Json fidelity_json(const Fidelity& f) {
  return {{"sections", f.sections},
          {"near_junctions", f.near_junctions},
          {"missed", f.missed},
          {"mean_radius_error", f.mean_radius_error},
          {"largest_radius_error", f.largest_radius_error},
          {"sections_beyond_5_percent", f.far_off},
          {"largest_radius_error_branch", f.largest_error_branch},
          {"largest_radius_error_at_mm", to_json(f.largest_error_at_mm)},
          {"largest_radius_error_near_junctions", f.largest_radius_error_near_junctions},
          {"mean_axis_offset_radii", f.mean_axis_offset},
          {"largest_axis_offset_radii", f.largest_axis_offset},
          {"largest_axis_offset_branch", f.largest_offset_branch},
          {"mean_smoothing_move_radii", f.mean_move_radii},
          {"largest_smoothing_move_radii", f.largest_move_radii},
          {"largest_smoothing_move_mm", f.largest_move_mm},
          {"largest_smoothing_move_branch", f.largest_move_branch},
          {"largest_clearance_move_radii", f.largest_clearance_move_radii},
          {"largest_clearance_move_branch", f.largest_clearance_move_branch},
          {"largest_total_move_radii", f.largest_total_move_radii},
          {"largest_total_move_mm", f.largest_total_move_mm},
          {"largest_total_move_branch", f.largest_total_move_branch}};
}

void print_json(const Json& json) { fmt::print("{}\n", json.dump(1, ' ')); }

}  // namespace angiospline::cli
