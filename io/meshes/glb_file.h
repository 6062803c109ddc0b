// glTF 2.0 in one binary file, for viewers and the web.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "base/result.h"
#include "kernel/geometry/triangle_mesh.h"

namespace angiospline {

struct GlbOptions {
  std::string name = "vessels";         // of the root node
  std::optional<MeshField> field = {};  // colours the wall instead of the colours of kinds
};

// glTF is in metres with Y up and the front along +Z; the world is millimetres, x left, y back, z
// up. A point (x, y, z) becomes (x, z, -y) / 1000: a rotation about x by -90 degrees, so nothing is
// mirrored.
Vec3 gltf_from_world(const Vec3& point_mm);

// The bytes of a file with one node, one mesh and one material for each part that has triangles,
// under a root; nodes carry the part's name and, in `extras`, its kind and radius. A field becomes
// COLOR_0, and its name and range stand in the root's `extras`. Coordinates are single precision.
// Requires a sound mesh, and a field with a value for each point. Errors: no triangles; more than 4
// GB.
Result<std::string> mesh_to_glb(const TriangleMesh& mesh, const GlbOptions& options = {});

// The same in a file, written atomically and only after the bytes have been read back.
Result<void> write_glb(const std::filesystem::path& path, const TriangleMesh& mesh,
                       const GlbOptions& options = {});

}  // namespace angiospline
