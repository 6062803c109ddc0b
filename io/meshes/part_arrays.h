// A mesh as pictures want it: arrays for each part, with one normal a point.
#pragma once

#include <cstdint>
#include <vector>

#include "kernel/geometry/triangle_mesh.h"

namespace angiospline {

// The points one part needs, numbered for it alone.
struct PartArrays {
  std::vector<int> points;             // columns of the mesh's points
  std::vector<Vec3> normals;           // unit; the mesh's on the wall, the plane's on a cap
  std::vector<std::uint32_t> indices;  // three a triangle, into `points`
};

// One for each part of a sound mesh; a part without triangles has empty arrays.
std::vector<PartArrays> arrays_of_parts(const TriangleMesh& mesh);

}  // namespace angiospline
