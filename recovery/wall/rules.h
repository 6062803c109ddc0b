// The tuned numbers of this room: what each one trades, in one place. docs/fit.md tells the story
// and gives the figures. Numbers that a user may want to change are in DisplacementOptions instead.
#pragma once

#include <cstddef>

namespace angiospline::wall_rules {

// Of the way to a centre of curvature that counts as inside: windows and places end there, since
// beyond it normals of a thin vessel meet.
inline constexpr double kBend = 0.9;
inline constexpr double kNormalScale = 1.4826;  // median absolute deviation to standard deviation

// ---- profiles (wall_profile)

inline constexpr int kProfileSteps = 16;   // Simpson's rule, even
inline constexpr double kTurn = 0.25;      // of the contrast: a rise that is no noise ...
inline constexpr double kTurnNoise = 4.0;  // ... and in standard deviations
inline constexpr double kSideFrom = 1.6;   // widths of a voxel from the wall: beyond its blur
inline constexpr double kSideTo = 3.6;
inline constexpr double kSideStep = 0.5;
inline constexpr double kLeastRingWeight = 0.1;  // of rings near the axis, which hold less vessel
inline constexpr double kLeastGrowth = 0.2;      // of a parallel surface's radii of curvature

// ---- levels and noise (wall_greys)

inline constexpr double kBestSnr = 20.0;        // beyond it other errors than noise count
inline constexpr double kNeighbourRise = 0.35;  // of the contrast: grey that is another vessel's
inline constexpr double kNoiseRise = 4.0;       // standard deviations of noise that are no vessel
inline constexpr double kOutsideWave = 5.0;     // radii over which the background may vary
inline constexpr double kInsideMean = 8.0;      // radii over which the inside is averaged
inline constexpr int kLevelRounds = 2;          // the second without the first one's outliers
inline constexpr double kNodeNoise = 0.65;  // of a voxel's noise left by interpolation in a profile
inline constexpr double kOutlier = 3.0;     // standard deviations from which a value counts less
inline constexpr double kNoiseFrom = 1.6;   // widths from the wall: voxels that show noise
inline constexpr double kNoiseTo = 4.6;
// Voxels: fewer inside say less about noise than those outside, background and all.
inline constexpr std::size_t kFewestInside = 50;
inline constexpr double kClearContrast =
    0.5;                              // of the median: nodes that a mean profile is made of
inline constexpr int kSagSteps = 16;  // of the mean profile, even

// Of the fit of a blurred edge to the mean profile, in voxel widths.
struct EdgeProfileFit {
  double difference = 1e-4;  // of place and width, for derivatives
  double first_width = 0.4;
  double narrowest = 0.15;  // no image is sharper than that
  double longest_step = 0.3;
  int rounds = 12;
};
inline constexpr EdgeProfileFit kEdgeProfileFit;

// ---- Rician noise (rician_noise)

inline constexpr double kFarAmplitude = 12.0;    // over sigma: from here the series is exact enough
inline constexpr std::size_t kFewestGreys = 50;  // on either side: fewer do not tell noises apart
inline constexpr std::size_t kMostGreys = 20000;    // more say nothing new
inline constexpr double kLeastLogLikelihood = 5.0;  // by which Rician noise must explain more
inline constexpr double kLeastGrey = 0.05;          // of sigma: greys are rounded, and levels vary

// ---- the mesh (wall_mesh)

inline constexpr double kLeastCotangent = 0.02;  // keeps the stiffness of slivers positive
inline constexpr double kLeastWeight = 1e-9;     // a component without any weight stays solvable
inline constexpr double kLeastMass = 1e-3;  // of the mean: a node of slivers alone still has a say
inline constexpr double kLargestRadius = 3.0;  // of a node, in its region's radii
inline constexpr double kShortestEdge = 0.15;  // of the mesh, in the largest radius
inline constexpr double kLongestEdge = 0.4;
inline constexpr int kTraceProbes = 6;  // of a trace by random signs: good to some ten percent

// ---- displacements (evidence_of_greys, displacement)

inline constexpr double kLevelMean = 3.0;       // radii over which a wall is averaged for levels
inline constexpr double kLeastContrast = 0.25;  // of the median: less is no wall
// The rule for waves, L = 32 SNR^-0.4 voxels: docs/fit.md has the experiment behind it.
inline constexpr double kWaveVox = 32.0;
inline constexpr double kWaveExponent = -0.4;
inline constexpr double kWaveRadii = 2.5;        // the longest L of factor one
inline constexpr double kOutlierFloorVox = 0.1;  // deviations of offsets are no smaller

}  // namespace angiospline::wall_rules
