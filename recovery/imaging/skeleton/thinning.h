// A mask becomes its central axis: thinning that never changes the topology.
#pragma once

#include "base/progress.h"
#include "base/result.h"
#include "recovery/imaging/image/image.h"
#include "recovery/imaging/mask/foreground.h"
#include "recovery/imaging/mask/neighborhood.h"

namespace angiospline {

// In which order boundary voxels are taken away.
enum class ThinningOrder {
  kSubfields,  // thesis 4.2: layer by layer, each layer in eight subfields (four in 2-D)
  kDistance,   // by growing distance to the background in mm, then by subfields: keeps the axis in
               // the middle where voxels are far from cubes and leaves a tenth of the
               // twigs; needs 4 bytes more for each foreground voxel and about twice the time
};

struct ThinningOptions {
  Connectivity connectivity = Connectivity::k26;
  ThinningOrder order = ThinningOrder::kSubfields;
};

// The central axis of `mask`, 1 in a background of 0, on the same grid.
// Laws: components, cavities and cycles are those of the mask; the axis is part of the mask; every
// voxel left is an end point (one neighbour) or not simple, so the axis is one voxel thick; nothing
// depends on the number of threads. Outside the image all is background. An image one voxel deep is
// thinned as 2-D. An empty mask stays empty; a hollow body becomes a closed sheet (fill cavities
// first). Time: one pass over the image, then proportional to the foreground. Memory: the argument
// (move it in to save a copy) and the boundary voxels, 4 bytes each (8 from 2^32 voxels up).
// Errors: stopped on request.
Result<Mask> thin(Mask mask, const ThinningOptions& options = {}, const Progress& progress = {});

// Removes simple voxels, end points included, until only those in `kept` are left among them: for
// an axis from which twigs were cut. Requires: the mask holds 0 and 1, and `voxels` are the offsets
// of all its foreground (others that are background by now may be among them). Topology is kept.
// Time: proportional to the lists, without a pass over the image.
void rethin(Mask& mask, const std::vector<std::size_t>& voxels,
            const std::vector<std::size_t>& kept, Connectivity connectivity = Connectivity::k26);

}  // namespace angiospline
