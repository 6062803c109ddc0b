// The tuned numbers of this room: what each one trades, in one place. Lengths are in the junction's
// unit, its largest radius, unless a comment says otherwise. docs/junctions.md tells the story.
#pragma once

#include <cstddef>
#include <numbers>

namespace angiospline::layout_rules {

// ---- the opening's circle (opening_arcs)

inline constexpr int kArcSamples = 24;       // of an arc that is fitted
inline constexpr int kArcSteps = 20;         // Gauss-Newton, at most
inline constexpr double kArcDamping = 1e-5;  // of sliding along the circle, which changes nothing

// ---- the target surface (target)

// Branches whose distance exceeds the least one by this many widths are lost in the sum.
inline constexpr double kNegligible = 20.0;
// The ray's start is rounded over this part of the radius, so that gradients have no kinks.
inline constexpr double kRoundedStart = 0.25;
// Pairs at this angle or less have the rounding asked for, at kWide or more 1 + kRounder times it.
inline constexpr double kAcute = 30 * std::numbers::pi / 180;
inline constexpr double kWide = 50 * std::numbers::pi / 180;
inline constexpr double kRounder = 0.8;
// The crotch fills up by log 2 times the width: this leaves it within half the smallest radius of
// the cylinders. Where the smallest is a twig, a width of kNarrow of the pair's own radius is kept.
inline constexpr double kWidest = 0.6;
inline constexpr double kNarrow = 0.15;
inline constexpr std::size_t kMostRays = 24;  // of a junction: arrays have room for these and cores
inline constexpr double kSameStart = 0.05;    // radii between starts that share a core
inline constexpr double kDisagreement = 1.02;  // minus the agreement: a pair's weight in the width
inline constexpr double kLeastRayStep = 0.01;  // towards the surface from outside, of the whole way
inline constexpr int kRayHalvings = 30;        // of the step that came to be inside
inline constexpr double kVanishing = 1e-290;   // sums of weights below this are lost

// ---- where a layout starts (start)

// Of the equal share of a turn that a sector keeps: unequal sectors cost the opening's circle
// accuracy (opening_arcs.h).
inline constexpr double kLeastSector = 0.5;
inline constexpr double kMostSector = 2.0;
inline constexpr int kSeamPasses = 60;  // of alternating projections

// ---- its relaxation (layout)

inline constexpr int kCoarse = 5;            // nodes on a patch's side, where moves go far
inline constexpr int kFine = 9;              // and where the net is fitted to them
inline constexpr double kLongestMove = 0.5;  // of a node in one sweep, in sides of the quads around
inline constexpr double kSettled = 0.01;     // moves in one sweep that are not worth another
inline constexpr double kFirstEpsilon = 0.5;  // of area that distortion tells from none
inline constexpr double kEpsilonFall = 0.85;  // a sweep
inline constexpr double kLeastEpsilon = 0.02;
inline constexpr int kFollowEvery = 8;    // sweeps, after which seams turn towards their legs
inline constexpr int kLengthsEvery = 10;  // sweeps, after which aimed lengths are taken anew
inline constexpr double kLeastSide =
    0.5;                                // radii of a leg or saddle that is aimed at: none dwindles
inline constexpr int kShortenings = 4;  // of a step that does not help, each to a third
inline constexpr double kLeastEigenvalue = 0.05;  // of a node's Hessian, of its largest

}  // namespace angiospline::layout_rules
