// A part of a wall's mesh, for work that concerns only a neighbourhood.
#pragma once

#include <vector>

#include "recovery/wall/wall_mesh.h"

namespace angiospline {

struct FitMeshPart {
  FitMesh mesh;
  std::vector<int> nodes;  // of the whole mesh, one for each of the part's

  // Values at the part's nodes as values of the whole mesh, 0 elsewhere.
  Eigen::VectorXd spread(const Eigen::VectorXd& values, int whole) const;
};

// The triangles whose corners all lie within `reach_mm` of one of the places (3 x n, n > 0), and
// their nodes. O(nodes log places).
FitMeshPart part_near(const FitMesh& whole, const Points3& places_mm, double reach_mm);

// The node nearest to each node of another mesh.
std::vector<int> nearest_nodes(const FitMesh& of, const FitMesh& to);

Points3 node_points(const FitMesh& mesh);

}  // namespace angiospline
