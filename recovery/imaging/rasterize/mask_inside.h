// A closed mesh as a mask.
#pragma once

#include "kernel/geometry/triangle_mesh.h"
#include "recovery/imaging/image/image.h"

namespace angiospline {

// 1 where a voxel's centre is inside the mesh, by the number of triangles between it and the
// border along its row of voxels (odd: inside); centres on the surface fall to either side.
// Requires a closed mesh. O(triangles + rows they cover + voxels).
Mask mask_inside(const TriangleMesh& mesh, const ImageGrid& grid);

// The same for the outline of a contour in a grid of one slice: points in order, closed.
Mask mask_inside(const Points3& outline_mm, const ImageGrid& grid);

}  // namespace angiospline
