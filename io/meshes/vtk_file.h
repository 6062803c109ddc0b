// VTK's XML files of surfaces (.vtp, .vtu), with the arrays other programs look for.
#pragma once

#include <filesystem>
#include <vector>

#include "base/result.h"
#include "kernel/geometry/triangle_mesh.h"

namespace angiospline {

// Writes the surface as PolyData (.vtp) or UnstructuredGrid (.vtu), by the suffix. Cell arrays:
// ModelFaceID (SimVascular: 1, 2, ... in the order of the parts) and CellEntityIds (VMTK: the walls
// 1, the caps 2, 3, ...). Field array: FaceNames, the name of ModelFaceID k at k - 1. Point arrays:
// Normals, and one for each of `fields`. Double precision, millimetres, LPS. Requires a sound mesh
// and fields of its size. Errors: another suffix; those of writing.
Result<void> write_vtk_mesh(const std::filesystem::path& path, const TriangleMesh& mesh,
                            const std::vector<MeshField>& fields = {});

// The surface in a .vtp or .vtu file: triangles (strips and polygons are split) with parts by
// ModelFaceID and FaceNames where present, else one part "surface". Points at one place are not
// merged. Errors name the file: not readable, no triangles, not finite.
Result<TriangleMesh> read_vtk_mesh(const std::filesystem::path& path);

}  // namespace angiospline
