#include "recovery/imaging/mask/neighborhood.h"

namespace angiospline {
namespace {

constexpr Block plane(int axis, int at) {
  Block bits = 0;
  for (int z = 0; z < 3; ++z)
    for (int y = 0; y < 3; ++y)
      for (int x = 0; x < 3; ++x)
        if ((axis == 0 ? x : axis == 1 ? y : z) == at) bits |= 1U << (x + 3 * y + 9 * z);
  return bits;
}

constexpr Block kNotLow[3] = {kBlockAll & ~plane(0, 0), kBlockAll & ~plane(1, 0),
                              kBlockAll & ~plane(2, 0)};
constexpr Block kNotHigh[3] = {kBlockAll & ~plane(0, 2), kBlockAll & ~plane(1, 2),
                               kBlockAll & ~plane(2, 2)};

constexpr Block faces() {
  Block bits = 0;
  for (int k = 0; k < kFaceNeighbors; ++k) bits |= block_bit(kNeighbors[static_cast<unsigned>(k)]);
  return bits;
}
constexpr Block kFaces = faces();
constexpr Block kVertices =
    (plane(0, 0) | plane(0, 2)) & (plane(1, 0) | plane(1, 2)) & (plane(2, 0) | plane(2, 2));
constexpr Block k18 = kBlockAll & ~kVertices & ~kBlockCenter;
constexpr Block kEdges = k18 & ~kFaces;
constexpr Block k26 = kBlockAll & ~kBlockCenter;

// Both shifts of a set by one voxel along an axis, inside the block.
constexpr Block step(Block s, int axis, int shift) {
  return ((s & kNotHigh[axis]) << shift) | ((s & kNotLow[axis]) >> shift);
}

constexpr Block grown_by_faces(Block s) {
  return s | step(s, 0, 1) | step(s, 1, 3) | step(s, 2, 9);
}

constexpr Block grown_by_all(Block s) {
  s |= step(s, 0, 1);
  s |= step(s, 1, 3);
  return s | step(s, 2, 9);
}

constexpr Block lowest_bit(Block s) { return s & (~s + 1U); }

// The set is not empty and one 26-connected piece.
bool is_one_piece_26(Block set) {
  Block piece = lowest_bit(set);
  if (piece == 0) return false;
  for (;;) {
    const Block next = grown_by_all(piece) & set;
    if (next == piece) return piece == set;
    piece = next;
  }
}

// The set touches the centre by a face, and all those faces lie in one of its 6-connected pieces.
bool touches_centre_in_one_piece_6(Block set) {
  const Block touching = set & kFaces;
  Block piece = lowest_bit(touching);
  if (piece == 0) return false;
  for (;;) {
    if ((touching & ~piece) == 0) return true;
    const Block next = grown_by_faces(piece) & set;
    if (next == piece) return false;
    piece = next;
  }
}

}  // namespace

bool is_simple(Block block, Connectivity connectivity) {
  const Block foreground = block & k26;
  const Block background = ~block & k26;
  return connectivity == Connectivity::k26
             ? touches_centre_in_one_piece_6(background & k18) && is_one_piece_26(foreground)
             : touches_centre_in_one_piece_6(foreground & k18) && is_one_piece_26(background);
}

bool is_end_point(Block block, Connectivity connectivity) {
  if (connectivity == Connectivity::k26) return std::popcount(block & k26) == 1;
  return std::popcount(block & kFaces) == 1 && std::popcount(block & kEdges) <= 1 &&
         std::popcount(block & kVertices) <= 1;
}

Block block_around(const Mask& mask, const Voxel& center) {
  Block block = 0;
  for (int z = -1; z <= 1; ++z)
    for (int y = -1; y <= 1; ++y)
      for (int x = -1; x <= 1; ++x) {
        const Voxel v{center[0] + x, center[1] + y, center[2] + z};
        if (mask.grid.contains(v) && mask[v] != 0) block |= block_bit({x, y, z});
      }
  return block;
}

}  // namespace angiospline
