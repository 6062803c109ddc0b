// Twigs go, vessels stay: pruning by length against the local radius.
#pragma once

#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "recovery/imaging/image/image.h"
#include "recovery/imaging/skeleton/vessel_graph.h"

namespace angiospline {

// The rule. Let a branch run from a junction to an end; let R be the largest distance to the mask's
// boundary within the junction, and r that within the part of the branch farther than R from the
// junction. The branch's lumen reaches beyond its parent's by
//   reach = max over its voxels v of (|v - junction| + distance of v to the boundary) - R.
// It is a twig if it has no such part, or if reach < radii * r + voxels * (largest spacing). It is
// the corner of an end that was cut flat or obliquely if the mean distance over that part is less
// than corner_fullness * r (a vessel keeps its width, a corner is a wedge with one half) and reach
// < corner_radii * r + voxels * (largest spacing).
struct PruningOptions {
  double radii = 1.5;   // a bump as wide as high is a twig; a stump longer than its width is not
  double voxels = 2.0;  // what a mask's staircase can raise
  double corner_fullness = 0.6;
  double corner_radii = 4.0;
  Connectivity connectivity = Connectivity::k26;
};

struct PrunedSkeleton {
  Mask skeleton;      // the axis without twigs, one voxel thick again
  VesselGraph graph;  // of that axis
  int twigs = 0;      // branches taken away
  int rounds = 0;     // passes over the graph, the last of which found nothing
};

// The axis of `mask` without its twigs. The least reaching twig goes first, and a junction that is
// left with two branches becomes part of one before the next is judged; then the axis is thinned
// again and the whole repeated until nothing goes. Ends of vessels, loops and components are kept.
// Requires: `skeleton` is a thinned part of `mask` on the same grid.
// Time: proportional to the axis and to its twigs' logarithm, and one pass over the image.
// Errors: stopped on request.
Result<PrunedSkeleton> prune_twigs(const Mask& mask, Mask skeleton,
                                   const PruningOptions& options = {},
                                   const Progress& progress = {});

// Distances from the voxels of an axis to its mask's boundary, for look-up by offset.
class AxisRadii {
 public:
  AxisRadii(const Mask& mask, const SkeletonLabels& labels);
  double at_mm(const Voxel& voxel) const;  // requires: a voxel of the axis

 private:
  ImageGrid grid_;
  std::vector<std::size_t> offsets_;
  std::vector<double> radii_mm_;
};

}  // namespace angiospline
