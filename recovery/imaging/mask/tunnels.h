// Tunnels that noise leaves in a mask: filled where they are too narrow to be loops of vessels.
#pragma once

#include <cstddef>

#include "base/progress.h"
#include "base/result.h"
#include "recovery/imaging/image/image.h"
#include "recovery/imaging/mask/topology_numbers.h"

namespace angiospline {

// A tunnel is narrow if a ball fits through it of at most `voxels` mean voxel edges, or of at most
// `lumen_share` times the distance to the wall that the place has once it is filled: a hole in a
// wide vessel may be wider than one between thin vessels.
struct TunnelOptions {
  double voxels = 1.5;
  double lumen_share = 0.6;
  double most_voxels = 3.0;  // wider ones are never looked for
};

struct ClosedTunnels {
  Mask mask;
  std::size_t tunnels = 0;   // loops fewer
  std::size_t voxels = 0;    // that became foreground
  TopologyNumbers topology;  // of the mask, foreground 26-connected
};

// The mask with its narrow tunnels filled. Closing by balls of growing radius (in mm, spacing
// honoured) offers groups of voxels, and a group is taken only if the Euler characteristic rises by
// it, so that nothing else of the mask's shape changes. Cavities that come about are filled too.
// A mask without loops, and one with more than `kMostTunnels` (a leak), comes back as it is.
// Time: a ball of voxels for each voxel of the surface, a few passes over the image; memory: none
// beyond the mask but the surface's lists. Error: stopped on request.
inline constexpr std::int64_t kMostTunnels = 500;
Result<ClosedTunnels> close_tunnels(Mask mask, const TunnelOptions& options = {},
                                    const Progress& progress = {});

}  // namespace angiospline
