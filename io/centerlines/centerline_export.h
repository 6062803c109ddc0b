// One centerline tree, many formats: the suffix says which.
#pragma once

#include <filesystem>

#include "base/result.h"
#include "modeling/tree/centerline_tree.h"

namespace angiospline {

// Nothing wrong with the target's suffix, or the error that write_centerline_file would end with.
Result<void> check_centerline_target(const std::filesystem::path& path);

// Writes the tree in mm, LPS: .swc, .csv, .graphml (a node a point), or .vtp (one
// polyline a branch with MaximumInscribedSphereRadius). The file appears whole or not at all.
// Errors: another suffix; those of writing.
Result<void> write_centerline_file(const std::filesystem::path& path, const CenterlineTree& tree);

}  // namespace angiospline
