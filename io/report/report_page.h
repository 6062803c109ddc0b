// The report's page before its facts are filled in.
#pragma once

#include <string_view>

namespace angiospline {

// The text of io/report/report_page.html, with the marks %FACTS% and %MESH% still in it.
std::string_view report_page();

}  // namespace angiospline
