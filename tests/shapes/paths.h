// Where the project's sources lie. One small file knows it, so that every other object is the same in every clone.
#pragma once

#include <filesystem>

namespace angiospline::testing_paths {

// The project's root.
std::filesystem::path source_folder();

}  // namespace angiospline::testing_paths
