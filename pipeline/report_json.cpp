#include "pipeline/report_json.h"

#include <algorithm>
#include <cstddef>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/index.h"
#include "io/model/certificate_json.h"

namespace angiospline {
namespace {

using Json = nlohmann::ordered_json;

// ---- the parts that several reports share

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

Json point_json(const Vec3& v) { return Json::array({v.x(), v.y(), v.z()}); }

Json seconds_json(const StageSeconds& stages) {
  Json json = Json::object();
  for (const auto& [stage, seconds] : stages) json[stage] = seconds;
  return json;
}

Json segmentation_json(const SegmentReport& report) {
  Json seeds = Json::array();
  for (const Vec3& seed : report.seeds_mm) seeds.push_back(point_json(seed));
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
                     {"position_mm", point_json(tree.nodes[n].position_mm)},
                     {"degree", degree[n]}});
  }
  Json branches = Json::array();
  for (const CenterlineBranch& branch : tree.branches) {
    branches.push_back({{"id", branch.name},
                        {"from", tree.nodes[index(branch.from)].name},
                        {"to", tree.nodes[index(branch.to)].name},
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
                        {"position_mm", point_json(contact.at_mm)},
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
          {"largest_radius_error_at_mm", point_json(f.largest_error_at_mm)},
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

Json topology_json(const TopologyNumbers& numbers) {
  return {{"components", numbers.components},
          {"cavities", numbers.cavities},
          {"cycles", numbers.cycles}};
}

// ---- fits

Json wall_json(const WallFit& fit) {
  const FitReport& report = fit.report;
  Json held = Json::array();
  for (const HeldRegion& h : report.held) held.push_back({{"region", h.name}, {"why", h.why}});
  return {{"method", "wall"},
          {"contrast", report.contrast},
          {"noise", report.noise},
          {"noise_kind", report.noise_kind == NoiseKind::kRician ? "rician" : "white"},
          {"snr", report.snr},
          {"mesh_nodes", report.nodes},
          {"control_points", report.control_points},
          {"control_points_before_reduction", report.control_points_before_reduction},
          {"reduction_mm", report.reduction_mm},
          {"wave_factor", report.wave_factor},
          {"degrees_of_freedom", report.degrees_of_freedom},
          {"mean_axis_move_mm", report.mean_axis_move_mm},
          {"mean_move_mm", report.mean_move_mm},
          {"without_edge", report.without_edge},
          {"recaptured", report.recaptured},
          {"refined", report.refined},
          {"held", held},
          {"mean_residual_mm", fit.mean_residual_mm}};
}

Json edges_json(const EdgeFit& fit, const std::vector<std::string>& without_edge) {
  return {{"method", to_string(fit.options.method)},
          {"potential", fit.options.potential == PotentialKind::kSpring ? "spring" : "gravity"},
          {"strength", fit.options.strength},
          {"termination", to_string(fit.report.termination)},
          {"mesh_nodes", fit.nodes},
          {"edges", fit.edges},
          {"control_points", fit.control_points},
          {"without_edge", without_edge},
          {"coarsening_mm", fit.coarsening_mm},
          {"angle_before_deg", fit.angle_before_deg},
          {"angle_after_deg", fit.angle_after_deg}};
}

Json figures_json(const PartFigures& p, const char* unit) {
  return {{"name", p.name},
          {"residual_force", {{"mean", p.residual_mean}, {"max", p.residual_most}, {"unit", unit}}},
          {"moved_mm", {{"mean", p.moved_mean_mm}, {"max", p.moved_most_mm}}}};
}

void add_truth(Json& json, const MaskComparison& c) {
  json["truth_voxels"] = c.truth_voxels;
  json["missed_voxels"] = c.missed + c.beyond;
  json["missed_percent"] = c.missed_percent;
  json["dice"] = c.dice;
  if (c.surface) {
    json["assd_mm"] = c.surface->mean_mm;
    json["hausdorff95_mm"] = c.surface->hausdorff95_mm;
  }
}

// ---- smoothing and batches

const char* word(SmoothedPart::Outcome outcome) {
  switch (outcome) {
    case SmoothedPart::Outcome::kClean:
      return "clean";
    case SmoothedPart::Outcome::kSmoothed:
      return "smoothed";
    case SmoothedPart::Outcome::kRefused:
      break;
  }
  return "refused";
}

Json smoothing_json(const SmoothedFile& smoothed) {
  Json parts = Json::array();
  for (const SmoothedPart& part : smoothed.parts) {
    Json json{{"name", part.name},
              {"outcome", word(part.outcome)},
              {"before_deg", part.before_deg},
              {"after_deg", part.after_deg},
              {"moved_mm", part.moved_mm}};
    if (!part.why.empty()) json["why"] = part.why;
    parts.push_back(std::move(json));
  }
  return {{"before_deg", smoothed.before_deg}, {"after_deg", smoothed.after_deg}, {"parts", parts}};
}

Json row_of(const BatchTree& tree) {
  const auto figure = [&](auto member) {
    return tree.figures ? Json((*tree.figures).*member) : Json();
  };
  return {{"name", tree.name},
          {"input", tree.input.string()},
          {"state", to_string(tree.state)},
          {"exit_code", tree.exit_code},
          {"branches", figure(&TreeFigures::branches)},
          {"junctions", figure(&TreeFigures::junctions)},
          {"loops", figure(&TreeFigures::loops)},
          {"failed", figure(&TreeFigures::failed)},
          {"solids", figure(&TreeFigures::solids)},
          {"closed", figure(&TreeFigures::closed)},
          {"valid", figure(&TreeFigures::valid)},
          {"self_intersecting", figure(&TreeFigures::self_intersecting)},
          {"volume_mm3", figure(&TreeFigures::volume_mm3)},
          {"max_normal_angle_deg", figure(&TreeFigures::max_normal_angle_deg)},
          {"seconds", tree.seconds},
          {"message", tree.message}};
}

std::string text_of(const Json& json) { return json.dump(1, ' '); }

}  // namespace

std::string json_text(const RecoveredFile& recovered) {
  Json json = model_json(recovered.model);
  json["segment"] = segmentation_json(recovered.segment);
  json["graph"] = graph_json(recovered.vessels.tree);
  json["contacts"] = contacts_json(recovered.vessels);
  json["seconds"] = seconds_json(recovered.seconds);
  json["files"] = recovered.files;
  json["check"] = to_json(recovered.certificate);
  return text_of(json);
}

std::string json_text(const BuiltFile& built) {
  Json json = model_json(built.model);
  json["seconds"] = seconds_json(built.seconds);
  json["files"] = built.files;
  json["fidelity"] = fidelity_json(built.fidelity);
  json["check"] = to_json(built.certificate);
  return text_of(json);
}

std::string json_text(const BatchReport& batch) {
  Json rows = Json::array();
  for (const BatchTree& tree : batch.trees) rows.push_back(row_of(tree));
  return text_of({{"trees", rows}, {"states", count_states(batch)}});
}

std::string json_text(const FittedFile& fitted) {
  const char* unit = fitted.wall ? "mm" : "potential";
  Json json = model_json(fitted.model);
  json["iterations"] = fitted.iterations;
  json["converged"] = fitted.converged;
  const Json all = figures_json(fitted.parts.back(), unit);
  json["residual_force"] = all["residual_force"];
  json["moved_mm"] = all["moved_mm"];
  json["parts"] = Json::array();
  for (std::size_t p = 0; p + 1 < fitted.parts.size(); ++p) {
    Json part = figures_json(fitted.parts[p], unit);
    part["iterations"] = fitted.iterations;
    part["converged"] = converged_part(fitted, fitted.parts[p].name);
    json["parts"].push_back(part);
  }
  json["fit"] =
      fitted.wall ? wall_json(*fitted.wall) : edges_json(*fitted.edges, fitted.unconverged);
  if (fitted.truth) add_truth(json, *fitted.truth);
  json["seconds"] = seconds_json(fitted.seconds);
  json["files"] = fitted.files;
  json["check"] = to_json(fitted.certificate);
  return text_of(json);
}

std::string json_text(const SmoothedFile& smoothed) {
  Json json = model_json(smoothed.model);
  json["smoothing"] = smoothing_json(smoothed);
  json["seconds"] = seconds_json(smoothed.seconds);
  json["files"] = smoothed.files;
  json["check"] = to_json(smoothed.certificate);
  return text_of(json);
}

std::string json_text(const WrittenMask& written) {
  Json json = segmentation_json(written.report);
  json["seconds"] = seconds_json(written.seconds);
  return text_of(json);
}

std::string json_text(const WrittenMultimodalMask& written) {
  const MultimodalReport& report = written.report;
  return text_of({{"voxels", report.voxels},
                  {"examined", report.examined},
                  {"by_volume", report.by_volume},
                  {"by_views", report.by_views},
                  {"by_both", report.by_both},
                  {"limit_reached", report.limit_reached},
                  {"seconds", seconds_json(written.seconds)}});
}

std::string json_text(const ThinnedFile& thinned) {
  Json json{{"voxels_in", thinned.voxels_before}, {"voxels_out", thinned.voxels_after}};
  if (thinned.topology_before) json["before"] = topology_json(*thinned.topology_before);
  if (thinned.topology_after) json["after"] = topology_json(*thinned.topology_after);
  json["seconds"] = seconds_json(thinned.seconds);
  return text_of(json);
}

std::string json_text(const GraphedFile& graphed) {
  Json json = graph_json(graphed.vessels.tree);
  json["contacts"] = contacts_json(graphed.vessels);
  json["twigs_pruned"] = graphed.vessels.twigs;
  json["seconds"] = seconds_json(graphed.seconds);
  return text_of(json);
}

std::string json_text(const Certificate& certificate, const std::optional<Fidelity>& fidelity) {
  Json json = to_json(certificate);
  if (fidelity) json["fidelity"] = fidelity_json(*fidelity);
  return text_of(json);
}

}  // namespace angiospline
