// The tuned numbers of this room: what each one trades, in one place.
#pragma once

namespace angiospline::solid_rules {

// ---- closing a network (network_closure, solid)

// A measured gap is the largest of some samples: the true one may be a little larger.
inline constexpr double kGapMargin = 1.5;
inline constexpr int kGapSamples = 17;  // of a join, its ends among them
// Joined sides that lie farther apart than this, in radii, are not the same curve; a rim whose
// control points do, from their plane, is not plane.
inline constexpr double kLargestGap = 1e-3;
// Within this share of its size a rim lies in its own plane, and no other one is fitted.
inline constexpr double kFlatRim = 1e-9;
// Chords of an edge by which the side is found around which a loop runs.
inline constexpr int kLoopChords = 16;
// Parameters that run at unit speed but for rounding: two ends' worth of it.
inline constexpr double kUnitSpeed = 4e-16;

// ---- a foreign solid (solid_boundary)

// Parameters count as equal within this share of the domain: files keep 15 digits.
inline constexpr double kParameterTolerance = 1e-9;
inline constexpr int kSidePoints = 5;  // of a parameter curve, that must lie on a patch's side
// Edges cover a whole patch's perimeter (4, each side counting 1) but for this.
inline constexpr double kPerimeterSlack = 1e-6;
inline constexpr int kPanels = 8;      // for curves that are not splines, each integrated by itself
inline constexpr int kStopEvery = 64;  // faces between looks at whether to stop
// OpenCASCADE's mesh of trimmed faces: the chord's share of the solid's size, and radians.
inline constexpr double kMeshDeflection = 2e-3;
inline constexpr double kMeshAngle = 0.3;

// ---- meshes of boundaries (boundary_mesh)

inline constexpr int kTurnSamples = 4;     // of a knot span, to see how far its tangent turns
inline constexpr int kMostIntervals = 64;  // of a span, before the whole mesh is made finer
inline constexpr double kEdgeMargin =
    1e-9;  // of an edge: a grid line nearer to its end is the end's

}  // namespace angiospline::solid_rules
