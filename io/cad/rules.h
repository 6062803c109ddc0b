// The tolerances and steps of CAD files.
#pragma once

namespace angiospline {

// A surface is compared with what is read back at so many even steps of its domain, each way.
inline constexpr int kDigestSteps = 6;

// How far a surface may move on its way through a file, in sizes of the model: by the rounding of
// the digits written, and nothing else.
inline constexpr double kDigestTolerance = 1e-9;

// Steps at which a side of a patch is measured, for each span of its knots.
inline constexpr int kSideSamplesPerSpan = 8;

// In pieces of a side: rounding does not add one.
inline constexpr double kPieceSlack = 1e-6;

// Elements around a vessel in the script for Gmsh, and how many would fit around the thinnest one
// if they had the least size allowed: sharp crotches would ask for dust.
inline constexpr int kGmshElementsAround = 12;
inline constexpr int kGmshMostElementsAround = 16;

}  // namespace angiospline
