#include "base/version.h"

namespace angiospline {

std::string version() { return ANGIOSPLINE_VERSION; }

}  // namespace angiospline
