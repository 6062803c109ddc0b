// The tuned numbers of segmentation, each with its unit and what it trades. docs/segmentation.md
// tells what they were tried on. Not installed.
#pragma once

#include <cstddef>
#include <cstdint>

namespace angiospline::segmentation {

// ---- What stands out at a seed (segment.cpp, seed_levels.cpp)

// Contrast in root sums of the squared deviations of vessel and background. Noise cut in two at its
// middle has classes 1.9 apart and by chance up to 2.35; a tube of radius 2.5 voxels at SNR 1,
// smoothed, has 2.7. Higher refuses faint vessels, lower takes noise for one.
constexpr double kLeastSeparation = 2.4;
// Half edges of the cubes tried around a seed, in voxels, and the ratio from one to the next: the
// smallest that shows background is taken, so that other vessels stay outside.
constexpr double kSmallestCube = 5, kLargestCube = 80, kNextCube = 1.4;
constexpr std::size_t kLeastVoxels = 27;  // finite ones of a cube that can be judged
constexpr double kLeastBackground = 0.6;  // share of a cube's voxels
constexpr std::size_t kLeastInside = 8;   // voxels away from the wall; with fewer all of it counts

// ---- The rule of growing that follows from the levels (segment.cpp, adaptive_threshold.h)

constexpr int kLeastN = 5, kMostN = 11;      // edge of the neighbourhood, voxels (thesis 4.1)
constexpr double kLeastM = 1, kMostM = 2;    // standard deviations below mean(S1) (thesis: 1 to 4)
constexpr double kMostOfContrast = 0.5;      // that M sigma may reach down: the middle
constexpr double kBackgroundDeviations = 2;  // above the background's level: the threshold below
constexpr double kLeastFloor = 0.2;          // which no voxel is looked at, kept within these
constexpr double kMostFloor = 0.4;           // shares of the contrast
constexpr double kSurely = 0.5;   // share of the way from background to mean(S1): vessel above,
constexpr double kHardly = 0.45;  // none below, whatever M says; between them M decides
constexpr double kThick = 0.3;   // share of the neighbourhood that is vessel, for fading to be seen
constexpr double kEdges = 0.85;  // what the edges leave of the mean at the wall of such a vessel
constexpr double kLeastFading = 0.25;  // to which share of the seeds' level a signal is followed

// ---- Leaks and swellings (segment.cpp, region_growing.cpp)

constexpr std::int64_t kLoopsOfALeak = 20;  // more loops than that are tissue, not vessels
constexpr std::size_t kMuch = 10;           // a first try looks at one part in so many of the image
constexpr int kAttempts = 8;                // with higher and higher background thresholds
constexpr double kStep = 0.1;               // of the contrast from one to the next
constexpr double kAboveNeck = 0.01;         // of the contrast above the neck that is to be shut
constexpr int kSeedReach = 2;  // voxels beside a found seed in which its vessel may lie
// A leap of the front is worth telling from so many voxels on, and from one part in so many of what
// was vessel before.
constexpr std::size_t kLeastLeap = 100, kLeastLeapShare = 4;
constexpr std::size_t kLeastBefore = 100;  // voxels before a neck: a piece of the vessel
// By how much a neck is darker than the vessel: of the contrast, and in the vessel's deviations.
// Less is noise.
constexpr double kDarker = 0.1, kDarkerDeviations = 3;

// ---- The search for seeds (seed_search.cpp)

constexpr double kSeedGrid = 192;  // cells along the longest edge: time against thin vessels
constexpr int kUnknownBorder =
    2;                      // cells: a border answers to what lies beyond it, which nobody knows
constexpr int kBorder = 4;  // cells from a face of the image that count as along it,
constexpr int kThinImage = 16;          // across directions of more cells than this
constexpr double kMostBorder = 0.5;     // share of a structure along the border
constexpr double kLeastTubeness = 0.4;  // a tube's core has 0.86, a ball 0.12, a sheet 0
constexpr double kLeastLength = 4;      // radii of its core, unless the border cuts it off
constexpr float kStructure = 0.25F;     // of the strongest answer: what belongs to a structure
constexpr double kLeastTotal = 0.03;    // of the largest sum of answers: what is looked at
constexpr int kRounds = 4;              // each at less than a quarter of the answers before

}  // namespace angiospline::segmentation
