// GraphML: nodes with positions, radii at nodes or edges; loops and several components as they
// come.
#pragma once

#include <string>
#include <string_view>

#include "base/result.h"
#include "io/reading/reader_options.h"
#include "modeling/tree/centerline_tree.h"

namespace angiospline {

// Attributes are known by name: x, y, z (pos_x, X ...), radius (r) or diameter at nodes or at
// edges, branch at edges. Where both nodes and edges have radii the edges' are taken.
// In a directed graph flow enters at the ends that no edge enters.
Result<CenterlineTree> parse_graphml(std::string_view text, std::string_view name,
                                     const CenterlineFileOptions& options = {});

// The tree as GraphML in mm: a node for each point (x, y, z, radius), an edge for each pair of
// neighbours (branch). A branch whose radius at a node differs from the node's gets a copy of it.
std::string graphml_text(const CenterlineTree& tree);

}  // namespace angiospline
