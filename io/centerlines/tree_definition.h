// A plain text definition of a vessel tree, for people who write trees by hand
// (docs/centerlines.md).
#pragma once

#include <string_view>

#include "base/result.h"
#include "io/reading/reader_options.h"
#include "modeling/tree/centerline_tree.h"

namespace angiospline {

// One statement a line; words are separated by spaces or tabs; `#` starts a comment:
//   unit UNIT                              before the first node; mm if it is missing
//   node NAME X Y Z
//   branch NAME FROM TO RADIUS [RADIUS]    one radius, or those at FROM and TO
//   point X Y Z [RADIUS]                   the branch above passes here, in this order
//   inlet NODE ...                         where flow enters
// A branch runs smoothly (centripetal Catmull-Rom) through its points; a radius that is not given
// varies linearly with the length between those that are. Nodes and branches keep their names.
Result<CenterlineTree> parse_tree_definition(std::string_view text, std::string_view name,
                                             const CenterlineFileOptions& options = {});

}  // namespace angiospline
