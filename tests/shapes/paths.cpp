#include "tests/shapes/paths.h"

namespace angiospline::testing_paths {

std::filesystem::path source_folder() { return ANGIOSPLINE_SOURCE_DIR; }

}  // namespace angiospline::testing_paths
