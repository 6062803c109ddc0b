// Nevatia-Babu edge masks: ideal steps in many directions, built from their definition.
#pragma once

#include <array>
#include <vector>

#include "base/vector.h"
#include "recovery/imaging/image/image.h"

namespace angiospline {

// One direction of a step through the centre of 5 x 5 x 5 voxels (5 x 5 x 1 for a flat grid).
struct EdgeMask {
  Vec3 normal = Vec3::Zero();  // unit, mm along the grid's own axes; points to the bright side
  // By offset from -2 to 2, x fastest: 2 f - 1, with f the share of the voxel on the bright side of
  // the plane through the centre. So 1 where bright, -1 where dark, and the exact partial volume
  // between. Laws: weight(-x) = -weight(x) bit for bit, hence the sum is 0; masks of the same grid
  // whose normals are images of each other under a symmetry of the grid are the same images.
  std::array<double, 125> weights{};

  double weight(const Voxel& offset) const {
    return weights[static_cast<std::size_t>((offset[2] + 2) * 25 + (offset[1] + 2) * 5 + offset[0] +
                                            2)];
  }
};

// The share of a box with the given edges, centred at `centre`, where normal . x > 0: exact, by
// inclusion and exclusion over the box's corners. Requires edges above 0 and a normal that is not
// 0; components below 1e-9 of the largest count as 0.
double share_beyond_plane(const Vec3& centre, const Vec3& edges, const Vec3& normal);

// The mask of one normal on voxels of this spacing. With `flat` only the plane z = 0 has weights.
EdgeMask edge_mask(const Vec3& normal, const Vec3& spacing_mm, bool flat);

// The directions in steps of 30 degrees, one of each opposite pair: the other one's mask is the
// negative. Volumes: the thesis turns the step about z by theta and then about x by phi (section
// 6.1); theta = 0, 30 .. 330 and phi = 0, 30 .. 150 are 72 pairs of angles and 62 distinct
// directions, as theta = 0 and theta = 180 do not feel phi. The thesis says 64; the two more could
// only be copies, so that there are 31 pairs here. Flat grids: 12 directions, 6 pairs, as Nevatia &
// Babu, Linear feature extraction and description, CGIP 13 (1980).
std::vector<Vec3> edge_directions(bool flat);

// The masks of a grid, half of each, ready for use: as weight(-x) = -weight(x), a response is a sum
// over half the offsets of weight times the difference I(x) - I(-x), and the differences are shared
// by all masks. Responses are scaled so that a mask answers a step of its own direction with the
// step's height in grey values: that is the height of the step that fits best by least squares.
struct EdgeMaskBank {
  static constexpr int kLanes = 32;  // masks, padded with zeros to whole vectors

  bool flat = false;
  std::vector<Vec3> normals;   // of the grid's own axes; one of each pair
  std::vector<Voxel> offsets;  // 62 of the 124 (12 of 24 when flat)
  std::vector<float> weights;  // offset k, mask m at k * kLanes + m; scaled
  // For any differences d with first moments g_i = sum x_i d over the offsets: no response is above
  // gradient_gain |g| + rest_gain |d - sum g_i x_i / moment|, with moment = sum x_i^2. (A mask is
  // its linear part plus a rest orthogonal to it; Cauchy-Schwarz on each.) Volumes only.
  double moment = 0;
  double gradient_gain = 0;
  double rest_gain = 0;

  explicit EdgeMaskBank(const ImageGrid& grid);
  int pairs() const { return static_cast<int>(normals.size()); }
};

}  // namespace angiospline
