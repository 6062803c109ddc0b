// The version of this library, as files and the command state it.
#pragma once

#include <string>

namespace angiospline {

std::string version();  // "1.2.3"

}  // namespace angiospline
