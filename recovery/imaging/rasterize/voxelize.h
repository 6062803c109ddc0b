// A closed surface as voxels: how much of each it fills, and which are inside.
#pragma once

#include "base/result.h"
#include "kernel/geometry/triangle_mesh.h"
#include "recovery/imaging/image/image.h"

namespace angiospline {

// The filled share of each voxel of `grid`, in [0, 1]: `rows` x `rows` lines along x through each
// voxel, each cut exactly where the surface crosses it, so that a face across the lines is exact to
// rounding. Where the surface overlaps itself a place counts once. Requires a closed mesh, wound
// outward, and rows in 1 .. 16. A line through an edge or a point of the mesh crosses it once or
// not at all, never twice. O(crossings log crossings + voxels).
Image<float> filled_share(const TriangleMesh& mesh, const ImageGrid& grid, int rows = 4);

// The voxels at least half filled.
Mask voxelized(const TriangleMesh& mesh, const ImageGrid& grid);

// The voxels whose centre is inside, by one line through the centres of each row; centres on the
// surface fall to either side. Requires a closed mesh, wound outward. O(triangles + lines they
// cover + voxels).
Mask mask_inside(const TriangleMesh& mesh, const ImageGrid& grid);

}  // namespace angiospline
