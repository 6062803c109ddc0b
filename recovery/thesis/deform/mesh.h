// Finite-element meshes: the control meshes of refined surfaces, and closed contours (thesis 3.1,
// 5.1).
#pragma once

#include <array>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "base/result.h"
#include "kernel/geometry/triangle_mesh.h"
#include "modeling/network/surface_network.h"

namespace angiospline {

// Nodes, and springs between neighbours. A node has four neighbours inside a patch and along most
// shared boundaries, three on the rim of an opening, six at the pole of a bifurcation.
struct DeformMesh {
  Points3 nodes_mm;
  Eigen::Matrix2Xi springs;  // pairs of nodes, the smaller first, in growing order
  // Quadrilaterals, counter-clockwise seen from outside. None: a closed contour in the plane of z,
  // counter-clockwise, node k next to k + 1 (a 2-D model).
  std::vector<std::array<int, 4>> faces;

  int node_count() const { return static_cast<int>(nodes_mm.cols()); }
  bool is_contour() const { return faces.empty(); }
};

// A circle of `count` nodes, the first at angle 0. Requires count >= 3 and a positive radius.
DeformMesh circle_contour(const Vec3& centre_mm, double radius_mm, int count);

// Neighbours of each node, and of each node their number. O(nodes).
std::vector<std::vector<int>> neighbours(const DeformMesh& mesh);

// Unit normals at the nodes, outward: the mean of the faces around by area, or of the two sides of
// a contour by length; 0 where that vanishes. O(nodes).
Points3 node_normals(const DeformMesh& mesh);

// Nodes of a tube in rows around it: node at (row, column) is at row * columns + column of `order`,
// columns run around. A contour is one row. Nothing for any other mesh. O(nodes).
struct PeriodicGrid {
  int rows = 0;
  int columns = 0;
  std::vector<int> order;
};
std::optional<PeriodicGrid> periodic_grid(const DeformMesh& mesh);

// The loops of nodes along the openings, each with the mesh on its left seen from outside; the loop
// with the smallest node first. O(nodes).
std::vector<std::vector<int>> openings(const DeformMesh& mesh);

// The mesh as triangles; openings are closed by fans about the mean of their nodes if asked for.
enum class Caps { kOpen, kFans };
TriangleMesh triangles_of(const DeformMesh& mesh, Caps caps);

struct NetworkMeshOptions {
  // Each is a reason to cut; 0 (1) is none.
  double tolerance_mm = 0.0;     // bound on the distance of the control mesh from the surface
  double longest_side_mm = 0.0;  // of the control mesh
  int least_pieces = 1;          // of each knot span
  int most_nodes = 1000000;
};

// The same surfaces over knots so fine that the control mesh stands for them: each span is cut into
// equal pieces, as many as refine_to_tolerance wants on any patch that shares its boundaries, so
// that patches still meet control point by control point. Pool columns are the mesh's nodes.
// Errors: a figure that is negative or not finite; a join of parts of sides (names the patches);
// more nodes than allowed; those of refine_to_tolerance.
struct RefinedNetwork {
  SurfaceNetwork network;
  double distance_mm = 0.0;  // bound: no surface point is farther from its control mesh
};
Result<RefinedNetwork> refine_network(const SurfaceNetwork& network,
                                      const NetworkMeshOptions& options);

// The control mesh of a network: one node for each pool column that a patch uses, in their order.
// Requires that every pool column is used.
DeformMesh control_mesh(const SurfaceNetwork& network);

// The way back: `coarse` with the control points whose refinement comes nearest to the pool of
// `fine` in the mean square. Requires that `fine` is refine_network(coarse) with its pool moved.
// distance_mm is the largest distance of a fine control point from its refined one, and bounds the
// distance of the surfaces. Time: one sparse factorisation of the coarse pool's size.
RefinedNetwork coarsen_network(const SurfaceNetwork& fine, const SurfaceNetwork& coarse);

}  // namespace angiospline
