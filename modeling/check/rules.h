// The tuned numbers of this room: what each one trades, in one place.
#pragma once

#include <array>

namespace angiospline::check_rules {

// ---- faces (face_measure)

// Of each smooth piece of an edge: areas of plane and trimmed faces, that of polynomials up to
// degree 15 exactly.
inline constexpr int kEdgeGaussPoints = 8;
// Steps that are halved so often end at 1e-8 of the first: an extreme to rounding.
inline constexpr int kExtremeRounds = 26;
inline constexpr int kBoxSteps = 8;  // of each smooth piece of an edge, before an extreme is sought
// A grid misses an extreme of its patch by far less than this share of the patch's box.
inline constexpr double kGridSlack = 0.02;

// ---- edges (edge_measure)

// A normal shorter than this share of the mean on its face has no usable direction.
inline constexpr double kDegenerateNormal = 1e-9;
// Where a corner is singular its normal is taken so far inside, as a share of the way to the middle
// of the patch: the nearest place that has one.
inline constexpr std::array<double, 3> kInsideShares{1e-6, 1e-4, 1e-2};

// ---- self-intersections

// A crossing of coarse triangles counts if it remains with so many times finer ones.
inline constexpr std::array<int, 2> kFinerMeshes{4, 12};

// ---- fidelity: lengths in local radii

// A section this near to a junction is blended into it: it counts by itself.
inline constexpr double kNearJunction = 2.0;
inline constexpr double kFarOff = 0.05;      // error of a radius that is counted
inline constexpr int kSectionPoints = 24;    // shared out among the strips
inline constexpr int kLeastStripPoints = 3;  // of a section
inline constexpr int kRingPoints = 8;        // of a strip, for the centroid of a ring
inline constexpr int kNewtonSteps = 12;      // to where a parameter line meets the section's plane
inline constexpr double kOnPlane = 1e-6;     // a point is, within this share of its arm
inline constexpr double kRingStep = 0.25;    // between the rings that find a section's place
inline constexpr int kLeastRings = 8;
inline constexpr double kRingReach = 1.0;    // a ring's centroid this near is the path's place
inline constexpr int kLeastStations = 4;     // where sections are taken: one a radius, or more
inline constexpr int kClearanceSamples = 4;  // for each control point of a path
// A local search for the nearest point starts at the point's share of the way and so many windows,
// in shares of the path, beside it.
inline constexpr double kSearchWindow = 0.02;
inline constexpr std::array<double, 5> kSearchShifts{0.0, -1.0, 1.0, -3.0, 3.0};

}  // namespace angiospline::check_rules
