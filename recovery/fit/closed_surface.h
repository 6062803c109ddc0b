// A surface without openings: for vessels without branches, such as a sac or a blob.
#pragma once

#include <string>

#include "base/progress.h"
#include "base/result.h"
#include "modeling/network/model.h"
#include "recovery/imaging/image/image.h"

namespace angiospline {

// An ellipsoid of 6 n^2 bi-quintic patches, n = `divisions`: the faces of a cube, each cut n times
// along both sides, blown up. Neighbours have common tangent planes to rounding; it differs from
// the ellipsoid by less than 0.2 % of its half axes. The columns of `half_axes_mm` are those, at
// right angles. The region is "wall_<name>". Requires divisions of 1 to 4.
SurfaceNetwork closed_surface(const Vec3& center_mm, const Mat3& half_axes_mm,
                              const std::string& name, int divisions = 1);

// The patches of each region that is such a surface: bi-quintic Bezier patches that meet each other
// with whole sides and nothing else. By region; empty for all others.
std::vector<std::vector<int>> closed_patches(const SurfaceNetwork& network);

// The same surfaces with each of these patches cut in four at the middle of its parameters.
// Requires all patches of closed surfaces, or none. The first quarter keeps the patch's number.
SurfaceNetwork with_quartered(const SurfaceNetwork& network, const std::vector<int>& patches);

// Of a piece of a mask that becomes a closed surface.
inline constexpr int kFewestClosedVoxels = 30;

// One ellipsoid for each 26-connected piece of the mask (in closed_pieces.cpp), with its centre and
// second moments, the largest first. Pieces below 30 voxels are left out, with a warning that says
// how many. Errors: an empty mask, or one of small pieces only.
Result<Model> closed_model(const Mask& mask);

}  // namespace angiospline
