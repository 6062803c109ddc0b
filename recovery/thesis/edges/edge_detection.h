// Image to edges: where the grey value steps, how much and in which direction (thesis 6.1).
#pragma once

#include <cstdint>
#include <variant>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "recovery/imaging/image/any_image.h"

namespace angiospline {

// A voxel is an edge if its step is at least this high.
struct EdgeContrast {  // in grey values
  double least = 0.0;
};
struct EdgePercentile {  // higher than in this share of all voxels: 95 keeps about 5 of 100
  double percent = 95.0;
};
using EdgeThreshold = std::variant<EdgePercentile, EdgeContrast>;

enum class EdgeThinning {
  kNone,  // every voxel above the threshold: walls are two to five voxels thick, as the thesis has
          // it
  // Nevatia & Babu (1980): of three voxels across an edge only the strongest stays, where the two
  // neighbours along the direction run within 30 degrees of it; of equals the one that comes first.
  kAcross,
};

// How voxels that cannot be edges are told. Both give the same edges, bit for bit.
enum class EdgeGate {
  kMoments,  // by a bound on every mask's answer from five box sums
  kNone,     // all masks everywhere
};

struct EdgeOptions {
  EdgeThreshold threshold;
  EdgeThinning thinning = EdgeThinning::kNone;
  EdgeGate gate = EdgeGate::kMoments;
};

struct Edge {
  Voxel voxel{0, 0, 0};
  float strength = 0;       // height of the step that fits best, in grey values
  std::int16_t normal = 0;  // index into EdgeField::normals
};

struct EdgeField {
  std::vector<Edge> edges;    // x fastest
  std::vector<Vec3> normals;  // unit, world; from dark to bright
  double threshold = 0;       // least strength that was kept
  double strongest = 0;       // of all edges; 0: none
  std::size_t examined = 0;   // voxels that all masks were applied to
};

// The edges of an image by the masks of edge_masks.h: the strongest answer of all, and the
// direction of the mask that gave it (the first one of equals). Spacing is honoured: masks are the
// partial volumes of the grid's own voxels, directions are those of the world. An image with
// size[2] == 1 gets the twelve plane masks. Beyond the border the border value goes on.
//
// A percentile is that of a regular sample of at most 2^17 voxels (all of a smaller image): of n
// samples it has a standard error of 100 sqrt(p (1 - p) / n) percent, 0.06 at 95.
//
// Errors: a voxel that is not finite (named); a constant image; a threshold that is not finite, a
// contrast not positive, a percentile not within 0 to 100; kCancelled. The same result on any
// number of threads. Time: about 1,900 multiplications a voxel that passes the gate, 40 for the
// others; memory beyond the edges: three slices of doubles a thread.
Result<EdgeField> find_edges(const AnyImage& image, const EdgeOptions& options = {},
                             const Progress& progress = {});

// The same for a known pixel type (those of AnyImage).
template <typename T>
Result<EdgeField> find_edges(const Image<T>& image, const EdgeOptions& options = {},
                             const Progress& progress = {});

}  // namespace angiospline
