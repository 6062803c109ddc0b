// The report's page before its facts are filled in.
#pragma once

#include <string_view>

namespace angiospline {

// page.html with style.css and the scripts (tables.js, plots.js, viewer.js, projections.js) in it,
// as CMake bundles them: one page that loads nothing. The marks %FACTS% and %MESH% are still in it.
std::string_view report_page();

}  // namespace angiospline
