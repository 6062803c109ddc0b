// One bi-quintic Bezier patch of a net: its 6 x 6 basis functions and its control points.
#pragma once

#include <array>

#include <Eigen/Core>

#include "base/vector.h"
#include "modeling/junction/unknowns.h"

namespace angiospline {

inline constexpr int kPatchSize = 6;
inline constexpr int kPatchPoints = kPatchSize * kPatchSize;

// A number for each control point, row by row along u: point (i, j) has number 6 i + j.
using PatchColumn = Eigen::Matrix<double, kPatchPoints, 1>;

// Values and first derivatives of the 36 functions at one place.
struct PatchBasis {
  PatchColumn value, u, v;
};

// The functions at (u, v) in [0, 1] x [0, 1]. Values add up to one, derivatives to zero.
PatchBasis patch_basis(const Vec2& uv);

// The control points of a patch, one column each.
using PatchNet = Eigen::Matrix<double, 3, kPatchPoints>;
PatchNet patch_net(const JunctionNet& net, int patch);

// The same where the points of the patch are listed by their numbers in the net.
PatchNet patch_net(const JunctionNet& net, const std::array<int, kPatchPoints>& points);

}  // namespace angiospline
