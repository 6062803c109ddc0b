// Tangent-plane continuity of a whole network, made again where it was lost.
#pragma once

#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "modeling/network/surface_network.h"

namespace angiospline {

struct SmoothNetworkOptions {
  double clean_deg = 1e-3;  // parts whose normals nowhere differ by more are left as they are
  bool everything = false;  // no part is
};

// What became of one junction or body. Angles are the largest between normals over all its joins.
struct SmoothedPart {
  enum class Outcome {
    kClean,     // left as it was
    kSmoothed,  // its control points were moved
    kRefused    // smoothing it would fold it, or does not apply to it: left as it was, see `why`
  };
  std::string name;  // of its region
  Outcome outcome = Outcome::kClean;
  double before_deg = 0.0;
  double after_deg = 0.0;
  double moved_mm = 0.0;  // the farthest way of a control point
  std::string why;
};

struct SmoothedNetwork {
  SurfaceNetwork network;
  std::vector<SmoothedPart> parts;  // one for each region, in their order
  double before_deg = 0.0;
  double after_deg = 0.0;
};

// Bodies first (mend_body), then every junction for itself: the cofactor equations of all its inner
// edges, poles and opening points included, with openings held, their tangent planes kept and the
// surface moved as little as possible. A junction that comes out folded, turned by more than 60
// degrees anywhere or crossing itself is refused by name and keeps its control points. Junctions
// are independent and solved on all cores. Linear in the network.
// Errors: the first defect of the network; stopped on request.
Result<SmoothedNetwork> smooth_network(SurfaceNetwork network,
                                       const SmoothNetworkOptions& options = {},
                                       const Progress& progress = {});

}  // namespace angiospline
