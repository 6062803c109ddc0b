// A certificate as the JSON object that `check --json` prints.
#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "modeling/check/certificate.h"

namespace angiospline {

// Keys: solids, closed, valid, self_intersecting, volume_mm3, area_mm2, bounding_box_mm [lowest,
// highest], faces [{name, kind, area_mm2}], smooth_edges, free_edges, max_gap_mm,
// max_normal_angle_deg, worst_edge [name, name] (null without a smooth edge), worst_edge_at_mm,
// min_jacobian_ratio, min_jacobian_face, max_curvature_times_radius and max_curvature_face (null
// where no radius is known), genus (null unless closed), self_intersections [{faces, at_mm}],
// self_intersection_resolution_mm, edge_samples, warnings, warning_codes.
nlohmann::json to_json(const Certificate& certificate);

// The same figures as lines a person reads.
std::string to_text(const Certificate& certificate);

}  // namespace angiospline
