// The tuned numbers of this room: what each one trades, in one place. docs/fit.md tells the story.
// Lengths in voxels are in edges of a cube of a voxel's volume.
#pragma once

#include <array>
#include <cstddef>

namespace angiospline::capture_rules {

// ---- sections along a branch (stations)

inline constexpr double kStationRadii = 0.5;  // distance of sections, in radii ...
inline constexpr double kStationVox = 1.5;    // ... and at least in voxels
inline constexpr int kFewestStations = 4;

// ---- which sections are measured (capture)

inline constexpr double kRimVox = 1.5;  // of an end that is not looked at
// Radii count by these shares, one after the other, until `kFewestClear` sections are clear of
// other branches: a start that is too thick would have none.
inline constexpr std::array<double, 4> kClearShares{1.0, 0.7, 0.5, 0.35};
inline constexpr std::ptrdiff_t kFewestClear = 3;
inline constexpr double kNearJunction = 8;  // radii within which other branches are looked for

// ---- levels and evidence (levels)

inline constexpr double kInsideRadii = 12.0;  // along a branch over which its levels are averaged
inline constexpr double kOutsideRadii = 6.0;  // the background may rise
inline constexpr double kAroundVox = 2.5;     // beyond the wall, where noise is looked at
inline constexpr double kGoodEvidence = 0.6;  // of the contrast: the sections lie on the vessel
inline constexpr double kNoEvidence = 0.3;    // there is none
// Of discs that a lost tree is looked for in, in multiples of their usual size.
inline constexpr std::array<double, 5> kReaches{1.0, 1.5, 2.2, 3.3, 5.0};
inline constexpr double kEnoughContrast = 0.85;  // of the largest at any reach
inline constexpr double kLeastContrast = 0.3;    // of the noise around: less is no contrast
inline constexpr double kNormalScale = 1.4826;   // median absolute deviation to standard deviation

// ---- discs (greys)

inline constexpr std::size_t kNeighbours =
    4;                                     // sections on either side that a disc is averaged over
inline constexpr double kDiscRadii = 1.5;  // a disc's radius, in the section's ...
inline constexpr double kDiscVox = 3;      // ... and so much beyond
inline constexpr double kDiscCells = 10;   // cells from its centre to its rim, at most
inline constexpr std::size_t kFewestPart = 50;  // a part of fewer greys than one in so many is none

// ---- rounds (capture)

inline constexpr int kWideRounds = 6;
inline constexpr double kLeastArea = 0.05;  // of a disc that is bright: less is no vessel
inline constexpr int kFewestAngles = 16;    // of a section whose wall is measured
// Of a radius in one round: a section that went wrong does not run away.
inline constexpr double kLeastGrowth = 0.6;
inline constexpr double kMostGrowth = 1.7;
// Voxels on either side of the wall, in each narrow round.
inline constexpr std::array<double, 6> kWindows{2.0, 1.5, 1.0, 0.75, .5, .5};
inline constexpr int kNarrowRounds = static_cast<int>(kWindows.size());

// ---- smooth axes (axes)

inline constexpr int kAxisDegree = 5;
inline constexpr int kPenalisedOrder = 3;    // the change of curvature: arcs are free
inline constexpr int kFewestSections = 8;    // measured ones of a branch
inline constexpr double kSpanRadii = 0.5;    // knots need not lie closer
inline constexpr double kLeastNoise = 1e-3;  // in radii: far below any voxel, above rounding
// By which a branch's strength differs from its tree's: the deviation of a prior.
inline constexpr double kPriorDecades = 1.0;
// Strengths that are tried, in units of (radius)^6 / spacing, as powers of ten.
inline constexpr double kFirstStrength = -6.0;
inline constexpr double kStrengthStep = 0.5;
inline constexpr int kStrengths = 31;

}  // namespace angiospline::capture_rules
