// The 26 neighbours of a voxel, and 3x3x3 blocks of voxels as bits: topology as bit arithmetic.
#pragma once

#include <array>
#include <bit>
#include <cstdint>

#include "recovery/imaging/image/image.h"

namespace angiospline {

// How foreground voxels touch each other: by faces, edges or vertices (26), or by faces alone (6).
// The background then has the other one. In an image one voxel deep these are the 8 and 4 of 2-D.
enum class Connectivity { k26, k6 };

// The neighbours in the order in which every search of this folder visits them: faces +x -x +y -y
// +z -z, then edges, then vertices. With this order the level-order search numbers the nodes of
// figure 7.22 as the thesis does.
inline constexpr std::array<Voxel, 26> kNeighbors{{
    {1, 0, 0},   {-1, 0, 0}, {0, 1, 0},   {0, -1, 0},  {0, 0, 1},    {0, 0, -1}, {1, 1, 0},
    {-1, 1, 0},  {1, -1, 0}, {-1, -1, 0}, {1, 0, 1},   {-1, 0, 1},   {1, 0, -1}, {-1, 0, -1},
    {0, 1, 1},   {0, -1, 1}, {0, 1, -1},  {0, -1, -1}, {1, 1, 1},    {-1, 1, 1}, {1, -1, 1},
    {-1, -1, 1}, {1, 1, -1}, {-1, 1, -1}, {1, -1, -1}, {-1, -1, -1},
}};
inline constexpr int kFaceNeighbors = 6;  // the first six of kNeighbors

constexpr int neighbor_count(Connectivity c) {
  return c == Connectivity::k26 ? 26 : kFaceNeighbors;
}

// How strongly neighbour k of kNeighbors holds on: face 5, edge 3, vertex 1 (thesis 4.3).
constexpr int neighbor_weight(int k) { return k < kFaceNeighbors ? 5 : k < 18 ? 3 : 1; }

// A 3x3x3 block: bit x + 3 y + 9 z is voxel (x, y, z), the centre is bit 13. 1 is foreground.
using Block = std::uint32_t;
inline constexpr Block kBlockCenter = 1U << 13;
inline constexpr Block kBlockAll = (1U << 27) - 1;

constexpr Block block_bit(const Voxel& d) {  // d in {-1, 0, 1}^3
  return 1U << (13 + d[0] + 3 * d[1] + 9 * d[2]);
}

// True if the centre, turned to background, leaves the topology as it was: object connectivity and
// surface connectivity (thesis 4.2), here as the two component counts of G. Bertrand and G.
// Malandain
// ("A new characterization of three-dimensional simple points", Pattern Recognition Letters 15,
// 1994). Exact; the centre bit is ignored. About 20 ns.
bool is_simple(Block block, Connectivity connectivity);

// True if the centre has exactly one neighbour. For Connectivity::k6: one across a face, and at
// most one across an edge and one across a vertex, as at the end of a staircase. (Every second
// voxel of a flat side keeps one face neighbour while a subfield is taken away; those are teeth,
// not ends.)
bool is_end_point(Block block, Connectivity connectivity);

// The block around `center`; voxels outside the image are background.
Block block_around(const Mask& mask, const Voxel& center);

}  // namespace angiospline
