// A body moved to where its wall is, between ends that are given.
#pragma once

#include <vector>

#include "recovery/fit/rings.h"
#include "recovery/wall/wall_mesh.h"

namespace angiospline {

// Moves of a mesh's nodes along their normals.
struct WallMoves {
  const FitMesh& mesh;
  const Eigen::VectorXd& displacement_mm;
  Eigen::VectorXd mass_mm2;                // of each node
  std::vector<std::vector<int>> nodes_of;  // nodes whose origin is on each patch of the network

  Vec3 move_of(int node) const {
    return displacement_mm(node) * mesh.nodes[static_cast<std::size_t>(node)].normal;
  }
};

struct BodyFit {
  Points3 points;      // row by row
  double share = 1.0;  // of the way that it could go without folding
};

// Least squares over the rows between the ends, whose new places are in `pool`. The row next to an
// end moves with it unless it is free. A body that would fold is tried with stiffer moves, then
// over parts of the way; with share 0 only its ends move, and the rows between follow them. One
// that nothing moves has no points: it stays as it is.
BodyFit fit_body(const SurfaceNetwork& network, const WallMoves& wall, const StripRing& ring,
                 const Points3& pool, bool free_start, bool free_end);

}  // namespace angiospline
