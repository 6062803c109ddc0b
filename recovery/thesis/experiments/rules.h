// The settings of the experiments that the thesis states, or that stand in for what it does not.
#pragma once

#include <cstddef>

namespace angiospline::experiment_rules {

// ---- region growing (7.1.1)

inline constexpr double kRingsSnr = 20;
inline constexpr double kRingsLossDeg = 12;           // of lost signal every 45 degrees
inline constexpr double kRingsSeedTurn = 0.39;        // midway between two losses, of a ring
inline constexpr std::size_t kMostExamined = 200000;  // points: what leaks out of a ring ends there
// A larger neighbourhood may segment more points by this factor and still count as no more.
inline constexpr double kNoMorePoints = 1.02;

// ---- contours (7.3.2)

inline constexpr double kSliceSnr = 8;
inline constexpr double kSlicePercentile = 85;  // of the slice's voxels are weaker than an edge
inline constexpr double kSliceEdgeReach = 6;    // voxels from the artery's wall: others' edges
inline constexpr double kContourReach = 4;      // voxels: reach of the potentials
inline constexpr double kStartRadius = 6;       // voxels
inline constexpr int kStartSides = 12;
// Where no start is said: about a pixel beside the artery's centre.
inline constexpr double kStartBeside[] = {0.8, -0.5};
inline constexpr double kGroundDrag = 0.5;  // that lets a contour move as a whole
inline constexpr double kSlowRest = 0.03;   // voxels a unit of time: at strength 1 all is slower
inline constexpr int kQuickContour = 60;    // iterations of a quick run

// ---- volumes (7.3.3, 7.3.4)

inline constexpr int kMostIterations = 2000;
inline constexpr int kQuickVolume = 20;  // iterations of a quick run
// After so many iterations methods differ that come to the same place in the end.
inline constexpr int kUnderWay = 20;

}  // namespace angiospline::experiment_rules
