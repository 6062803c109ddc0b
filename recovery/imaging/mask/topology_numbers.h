// Components, cavities and cycles of a mask: what thinning must not change.
#pragma once

#include <cstdint>

#include "recovery/imaging/image/image.h"
#include "recovery/imaging/mask/neighborhood.h"

namespace angiospline {

// The Betti numbers of the foreground.
struct TopologyNumbers {
  std::int64_t components = 0;
  std::int64_t cavities = 0;  // pieces of background that do not reach the outside
  std::int64_t cycles = 0;    // independent tunnels: components + cavities - euler
  std::int64_t euler = 0;     // Euler characteristic

  bool operator==(const TopologyNumbers&) const = default;
};

// The numbers of `mask` in the given connectivity, the background having the other one; outside the
// image all is background. Exact. One pass over the image for the Euler characteristic (Gray's sum
// over 2x2x2 windows, all threads), one over its runs for the pieces.
TopologyNumbers topology_numbers(const Mask& mask, Connectivity connectivity = Connectivity::k26);

}  // namespace angiospline
