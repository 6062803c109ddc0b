// Node and edge tables of VesselVio and Voreen: vertices.csv and edges.csv, separated by ';' or
// ','.
#pragma once

#include <string_view>

#include "base/result.h"
#include "io/reading/reader_options.h"
#include "modeling/tree/centerline_tree.h"

namespace angiospline {

// Vertices: id; pos_x; pos_y; pos_z. Edges: node1id; node2id and a radius (avgRadiusAvg,
// radius_avg, radius, or a diameter). Edges run straight between their nodes and have one radius
// each. Lengths are voxels, taken for mm unless the unit is given. Errors as for all files, naming
// the table's line.
Result<CenterlineTree> parse_network_tables(std::string_view vertices,
                                            std::string_view vertices_name, std::string_view edges,
                                            std::string_view edges_name,
                                            const CenterlineFileOptions& options = {});

// Whether a table's first line looks like that of a vertex or an edge table.
bool is_vertex_table(std::string_view text);
bool is_edge_table(std::string_view text);

}  // namespace angiospline
