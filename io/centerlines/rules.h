// The tuned constants of readers of centerlines.
#pragma once

namespace angiospline {

// Samples along a curved branch of a tree definition lie this far apart, in radii, and are no more
// than so many in a piece: a hair of a thousand radii between two points is sampled more coarsely.
inline constexpr double kDefinitionSampleRadii = 0.5;
inline constexpr int kDefinitionMostSamples = 64;

// VascuSynth's own width of a voxel, in the unit of its radii.
inline constexpr double kVascuSynthVoxelWidth = 0.04;

// SimVascular models in centimetres; its files do not say so.
inline constexpr double kSimVascularUnitMm = 10.0;

}  // namespace angiospline
