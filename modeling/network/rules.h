// The tuned numbers of this room: what each one trades, in one place. Numbers that a user may want
// to change are in TessellationOptions instead.
#pragma once

namespace angiospline::network_rules {

// ---- how dense a mesh is (mesh_spacing)

// Flat places are not wide vessels: the local radius is at most this many radii of the region.
inline constexpr double kMostRadii = 8;
// Places in each knot span at which second derivatives are taken: sampled, not bounded.
inline constexpr int kSpacingSamples = 6;
// A normal shorter than this share of |Su| |Sv| is that of a singular place.
inline constexpr double kSingularNormal = 1e-9;
// Taken off a number of segments, so that it does not depend on the last bit of a symmetric shape.
inline constexpr double kSegmentHair = 1e-6;
// Radius of a network that knows none, as a share of its box's diagonal.
inline constexpr double kFallbackRadius = 0.05;
// Where there would be too many triangles: digits of the coarser tolerance, the least factor of a
// try, and how many tries; the last is a guard that no network is known to meet.
inline constexpr int kToleranceDigits = 2;
inline constexpr double kLeastCoarsening = 1.01;
inline constexpr int kCoarseningTries = 24;

// ---- the mesh (tessellation)

inline constexpr int kLeastEdgeSegments = 3;  // of an edge: no two edges can share a segment
inline constexpr int kLeastLineSegments = 2;  // across a patch: it has a point inside
inline constexpr int kLeastRing = 5;          // points of a cap's rings before the fan
// Of the two diagonals of a cell the first counts as shorter by this share, so that the choice does
// not depend on the last bit.
inline constexpr double kDiagonalHair = 1e-9;

}  // namespace angiospline::network_rules
