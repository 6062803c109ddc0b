// Where a junction's patches lie: a quad mesh relaxed on the target surface.
#pragma once

#include <vector>

#include "base/vector.h"
#include "modeling/layout/target.h"
#include "modeling/layout/topology.h"

namespace angiospline {

// The circle in which a branch leaves its junction, and the azimuths of its
// seams about `axis`, counted from x; y = axis x x.
struct OpeningFrame {
  Vec3 center = Vec3::Zero();
  Vec3 axis = Vec3::Zero();
  Vec3 x = Vec3::Zero();
  Vec3 y = Vec3::Zero();
  double radius = 0.0;
  std::vector<double> seams_rad;  // increasing, less than a turn apart

  Vec3 direction(double azimuth_rad) const {
    return std::cos(azimuth_rad) * x + std::sin(azimuth_rad) * y;
  }
};

// Nodes on every patch, shared along edges, and the target's normals there.
// Opening nodes lie on their circles, all others on the target.
struct JunctionLayout {
  SharedGrid grid;
  Points3 nodes;
  Points3 normals;
  std::vector<OpeningFrame> openings;
};

struct LayoutOptions {
  int coarse_sweeps = 60;    // on 5 x 5 nodes a patch, seams following their legs
  int fine_sweeps = 30;      // at most, on 9 x 9 nodes
  double area_weight = 0.5;  // of even areas against right angles
  double follow = 0.5;       // part of the way seams turn towards their legs, every eighth sweep
};

// Starts from the spherical Voronoi diagram of the directions, moved towards
// the crotches, then lessens the distortion of the quads node by node in the
// target's tangent planes; folds of the start come undone, and none arise,
// because distortion grows without bound towards a fold (Garanzha, Kaporin,
// Kudryavtseva, Protais, Ray, Sokolov: Foldover-free maps in 50 lines of code,
// ACM ToG 40, 2021). Poles and saddles find their places. Seams keep between
// half and twice an equal share of the turn; two sectors are always halves.
// `distances` are those of the openings along their branches, from where these
// begin. O(nodes * sweeps * branches).
JunctionLayout relaxed_layout(const JunctionTopology& topology, const JunctionTarget& target,
                              const std::vector<double>& distances,
                              const LayoutOptions& options = {});

}  // namespace angiospline
