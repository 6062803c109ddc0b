// STL: triangles without units or topology; ours are millimetres.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "base/result.h"
#include "kernel/geometry/triangle_mesh.h"

namespace angiospline {

enum class StlFormat { kAscii, kBinary };

// kParts: one solid for each part, under the part's name. kFlow: as OpenFOAM's meshers want it, one
// solid "wall" for all bodies and junctions, then the rims under their own names as single words.
enum class StlGrouping { kParts, kFlow };

struct StlOptions {
  StlFormat format = StlFormat::kAscii;
  StlGrouping grouping = StlGrouping::kParts;
};

// ASCII has nine digits, and a point has the same digits wherever it is used, so that a closed mesh
// stays closed when it is read back. Binary has single precision, no names, and the part's index in
// each facet's attribute. Requires a sound mesh.
std::string mesh_to_stl(const TriangleMesh& mesh, const StlOptions& options = {});

// The mesh in the bytes of either format. Corners with equal coordinates become one point; facets
// that collapse by that are left out. Names give parts their kind: "junction*", "inlet*",
// "outlet*", "cap*", else body; in binary there is one part, or one for each attribute if the
// header is ours. Errors name `file` and the line or the facet: truncated, not a number, not
// finite, no facet at all.
Result<TriangleMesh> mesh_from_stl(std::string_view bytes, const std::string& file);

// The same on files, written atomically.
Result<void> write_stl(const std::filesystem::path& path, const TriangleMesh& mesh,
                       const StlOptions& options = {});
Result<TriangleMesh> read_stl(const std::filesystem::path& path);

}  // namespace angiospline
