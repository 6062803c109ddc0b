// The tuned numbers of this room: what each one trades, in one place.
#pragma once

#include <cstddef>

namespace angiospline::edge_rules {

// ---- masks (edge_masks)

// Components of a normal below this share of the largest count as 0: their box's corners would
// divide by them.
inline constexpr double kNoWidth = 1e-9;
// Components of a unit direction that are 0 but for rounding.
inline constexpr double kNoComponent = 1e-12;

// ---- detection (edge_detection)

// Strengths that a percentile is taken of: its error is 0.06 % at 95 (edge_detection.h).
inline constexpr std::size_t kPercentileSample = std::size_t{1} << 17;
// The gate compares a bound in doubles with answers in floats: their rounding, at most 62 half ulps
// of the product of the norms, is far below this share of the bound.
inline constexpr double kGateSlack = 1e-4;
// The tighter bound of single voxels is tried on every so many rows, and kept up while it spares a
// quarter of the voxels that it is asked of.
inline constexpr int kRowsBetweenTries = 16;
inline constexpr int kWorthwhileSparing = 4;
// Neighbours across an edge run the same way within 30 degrees (Nevatia & Babu 1980), and this much
// of the cosine is rounding.
inline constexpr double kSameWayRounding = 1e-9;

// ---- localisation (edge_localisation): lengths in widths of a voxel along the edge's direction

inline constexpr int kAnswerReach = 2;       // voxels of answers around an edge's own
inline constexpr double kPeakStep = 0.125;   // before the parabola
inline constexpr double kHalfWindow = 1.5;   // of the profile sum
inline constexpr double kFarthest = 2.0;     // from the peak, or it is another edge
inline constexpr int kRounds = 4;            // of sum, then normal and curvatures at the new place
inline constexpr double kDifference = 0.75;  // voxels between values of a difference
// From the wall to a level that has no room further in.
inline constexpr double kPlateau = 2.0;
// Of the step's height: where grey rises by more outside the wall, something else begins.
inline constexpr double kLevelShare = 0.25;

}  // namespace angiospline::edge_rules
