// SWC: one point a line, "id type x y z radius parent"; the format of neurons, used for vessels
// too.
#pragma once

#include <string>
#include <string_view>

#include "base/result.h"
#include "io/reading/reader_options.h"
#include "modeling/tree/centerline_tree.h"

namespace angiospline {

// Dialects taken: spaces or tabs, `#` comments anywhere (one that says "unit: um" is believed), ids
// from any number and with gaps, parents before or after their children, parent -1 (or 0 where no
// point has the id 0) for a root, several roots, more than seven columns. `name` stands in errors.
Result<CenterlineTree> parse_swc(std::string_view text, std::string_view name,
                                 const CenterlineFileOptions& options = {});

// The tree as SWC in mm. Loops are cut at their last point, which repeats its position, so that
// parse_swc closes them again. Node names that are whole numbers stay ids where they are free.
std::string swc_text(const CenterlineTree& tree);

}  // namespace angiospline
