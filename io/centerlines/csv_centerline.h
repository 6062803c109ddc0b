// Tables of points: x, y, z, radius and, as the case may be, an id, a parent or a branch.
#pragma once

#include <string>
#include <string_view>

#include "base/result.h"
#include "io/reading/reader_options.h"
#include "modeling/tree/centerline_tree.h"

namespace angiospline {

// Columns are separated by `,` `;` or tabs (or spaces); with a header line they are found by name:
//   x, y, z (x_mm, pos_x, ...); radius (r) or diameter (d); id; parent; branch (line, edge), inlet
//   (1 at a point where flow enters).
// Without one: x, y, z, radius and perhaps a fifth, taken for the parent where it holds a -1, for
// the branch where equal values follow each other; what cannot be told is an error. `#` starts a
// comment. Parents refer to ids or, without an id column, to rows counted from 0 or 1. Rows of one
// branch are a line in their order; lines join where they share a position. With neither the rows
// are one line. With `;` or tabs a decimal comma is understood.
Result<CenterlineTree> parse_csv_centerline(std::string_view text, std::string_view name,
                                            const CenterlineFileOptions& options = {});

// The tree as CSV with the columns branch, x, y, z, radius in mm and inlet.
std::string csv_text(const CenterlineTree& tree);

}  // namespace angiospline
