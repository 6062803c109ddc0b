// The tuned numbers of this room: what each one trades, in one place. docs/centerlines.md tells the
// story. Numbers that a user may want to change are in CenterlineOptions instead.
#pragma once

#include <cstddef>

namespace angiospline::centerline_rules {

// ---- moving points to the middle of the lumen (centerlines_from_graph)

inline constexpr double kOpenWeight = 0.02;  // of a point whose section is open, against 1
inline constexpr double kLongestRay = 2.5;   // distances to the wall: beyond, a section is open
inline constexpr int kRecenterings = 2;
inline constexpr double kFirstSmoothing = 2.0;  // times the wavelength, while nothing is measured
// Half-width of the slab of voxels that are counted: shorter ones do not level out slices.
inline constexpr double kLeastSlabVoxels = 2.0;

// ---- tails of the axis in the corner of a free end (branch_points)

// The corner of a flat end is sqrt(2) radii from the nearest place that is a radius away from all
// walls: a tail ends within `radii` and `voxels` of the tip. Beyond the farther reach it is none.
struct TailRules {
  double radii = 1.5;
  double voxels = 2.0;
  double farthest_radii = 3.0;
  double farthest_voxels = 3.0;
};
inline constexpr TailRules kTail;

// ---- free ends (branch_tip)

struct TipRules {
  // Of the radius, and of its inverse: a section at a tip that is still the vessel's.
  double full_section = 0.9;
  double most_shift = 0.25;       // of a step: how fast a tip may turn
  double longest_radii = 2.5;     // a ray may go, ...
  double longest_voxels = 2.0;    // ... and these beyond
  double farthest_radii = 3.0;    // a tip may be taken on, ...
  double farthest_voxels = 3.0;   // ... and these beyond
  double direction_voxels = 3.0;  // the least length that a direction is taken over
  int rays = 37;                  // over the disc of a tip
};
inline constexpr TipRules kTip;

// ---- radii (branch_radii)

// To either side of a point: counts of voxels scatter too much to be taken singly.
inline constexpr double kCorrectionRadii = 2.0;
inline constexpr double kCorrectionVoxels = 3.0;
inline constexpr std::ptrdiff_t kMedianReach = 2;  // a median of five

// ---- smoothing on the graph (axis_smoothing)

// Share of the bending that the mass keeps at least; rounding of the factorisation is far below.
inline constexpr double kLeastMass = 1e-11;
// Of a chain's mean step: points that coincide would make the difference quotient blow up.
inline constexpr double kLeastStep = 0.1;

// ---- vessels that touch (vessels_from_mask)

inline constexpr int kPartings = 4;  // rounds: cutting may bring other contacts to light

}  // namespace angiospline::centerline_rules
