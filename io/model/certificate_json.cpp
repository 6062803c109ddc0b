#include "io/model/certificate_json.h"

#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace angiospline {
namespace {

using nlohmann::json;

json point(const Vec3& p) { return {p.x(), p.y(), p.z()}; }

json optional_text(const std::string& text) { return text.empty() ? json() : json(text); }

}  // namespace

json to_json(const Certificate& c) {
  json faces = json::array();
  for (const FaceCertificate& face : c.faces) {
    faces.push_back(
        {{"name", face.name}, {"kind", to_string(face.kind)}, {"area_mm2", face.area_mm2}});
  }

  json result;
  result["solids"] = c.solids;
  result["closed"] = c.closed;
  result["valid"] = c.valid;
  result["self_intersecting"] = c.self_intersecting;
  result["volume_mm3"] = c.volume_mm3;
  result["area_mm2"] = c.area_mm2;
  result["bounding_box_mm"] = {point(c.lowest_mm), point(c.highest_mm)};
  result["faces"] = std::move(faces);

  // What was measured at edges; null stands where there was none to measure.
  result["smooth_edges"] = c.smooth_edges;
  result["free_edges"] = c.free_edges;
  result["max_gap_mm"] = c.max_gap_mm;
  result["max_normal_angle_deg"] = c.max_normal_angle_deg;
  const bool has_worst = c.smooth_edges > 0;
  result["worst_edge"] = has_worst ? json(c.worst_edge) : json();
  result["worst_edge_at_mm"] = has_worst ? point(c.worst_point_mm) : json();
  result["min_jacobian_ratio"] = c.min_jacobian_ratio;
  result["min_jacobian_face"] = optional_text(c.min_jacobian_face);
  result["max_curvature_times_radius"] =
      c.max_curvature_times_radius ? json(*c.max_curvature_times_radius) : json();
  result["max_curvature_face"] = optional_text(c.max_curvature_face);
  result["genus"] = c.genus ? json(*c.genus) : json();

  result["self_intersections"] = json::array();
  for (const FaceCrossing& crossing : c.self_intersections) {
    result["self_intersections"].push_back(
        {{"faces", crossing.faces}, {"at_mm", point(crossing.at_mm)}});
  }
  result["self_intersection_resolution_mm"] = c.self_intersection_resolution_mm;
  result["edge_samples"] = c.edge_samples;
  result["warnings"] = texts_of(c.warnings);
  result["warning_codes"] = code_names_of(c.warnings);
  return result;
}

std::string to_text(const Certificate& c) {
  const auto yes = [](bool b) { return b ? "yes" : "no"; };
  std::string text;
  const auto line = [&](const char* what, const std::string& value) {
    text += fmt::format("{:<28}{}\n", what, value);
  };
  line("solids", fmt::format("{}", c.solids));
  line("closed", yes(c.closed));
  line("valid", yes(c.valid));
  line("self-intersecting", c.self_intersecting ? "yes" : "no");
  for (const FaceCrossing& x : c.self_intersections) {
    line("  crossing", fmt::format("{} and {} at ({:.4g}, {:.4g}, {:.4g}) mm", x.faces[0],
                                   x.faces[1], x.at_mm.x(), x.at_mm.y(), x.at_mm.z()));
  }

  line("volume", fmt::format("{:.9g} mm3", c.volume_mm3));
  line("area", fmt::format("{:.9g} mm2", c.area_mm2));
  line("bounding box", fmt::format("({:.6g}, {:.6g}, {:.6g}) to ({:.6g}, {:.6g}, {:.6g}) mm",
                                   c.lowest_mm.x(), c.lowest_mm.y(), c.lowest_mm.z(),
                                   c.highest_mm.x(), c.highest_mm.y(), c.highest_mm.z()));

  std::map<FaceKind, int> kinds;
  for (const FaceCertificate& face : c.faces) ++kinds[face.kind];
  std::string faces = fmt::format("{}", c.faces.size());
  for (const auto& [kind, count] : kinds) {
    faces += fmt::format(", {} {}", count, to_string(kind));
  }
  line("faces", faces);

  line("genus", c.genus ? fmt::format("{}", *c.genus) : "none: the surface is open");
  line("free edges", fmt::format("{}", c.free_edges));
  line("smooth edges", fmt::format("{}", c.smooth_edges));
  line("largest gap", fmt::format("{:.3g} mm", c.max_gap_mm));
  line("largest normal angle",
       c.smooth_edges > 0
           ? fmt::format("{:.3g} degrees, {} and {} at ({:.4g}, {:.4g}, {:.4g}) mm",
                         c.max_normal_angle_deg, c.worst_edge[0], c.worst_edge[1],
                         c.worst_point_mm.x(), c.worst_point_mm.y(), c.worst_point_mm.z())
           : "none: no smooth edge");
  line("smallest Jacobian ratio",
       fmt::format("{:.4g}, {}", c.min_jacobian_ratio, c.min_jacobian_face));

  if (c.max_curvature_times_radius) {
    line("largest curvature x radius",
         fmt::format("{:.4g}, {}", *c.max_curvature_times_radius, c.max_curvature_face));
  }
  for (const Warning& warning : c.warnings) line("warning", warning.text);
  return text;
}

}  // namespace angiospline
