// The figures that scripts rely on, as JSON; only the commands' source files include this.
#pragma once

#include <nlohmann/json.hpp>

#include "cli/stages.h"
#include "modeling/check/fidelity.h"
#include "modeling/network/model.h"

namespace angiospline::cli {

using Json = nlohmann::ordered_json;

Json to_json(const Vec3& v);
Json seconds_json(const Stopwatch& watch);
Json segmentation_json(const SegmentReport& report);
Json graph_json(const CenterlineTree& tree);
Json contacts_json(const Vessels& vessels);

// branches, junctions, loops, failed, assumptions, warnings: what seed and recover share.
Json model_json(const Model& model);

// sections, mean_radius_error, largest_radius_error (away from junctions, parts of the radius) and
// its branch; axis offsets and what smoothing moved, in radii and mm.
Json fidelity_json(const Fidelity& fidelity);

// One line on standard output.
void print_json(const Json& json);

}  // namespace angiospline::cli
