// The vertices, edges and loops of a surface network: its boundary representation without geometry.
#pragma once

#include <array>
#include <vector>

#include "base/result.h"
#include "modeling/network/surface_network.h"

namespace angiospline {

// One join, or one side of a rim. The edge runs along the growing parameter of sides[0].
struct NetworkEdge {
  std::array<Side, 2> sides;  // sides[1] is there for a join only
  bool reversed = false;      // sides[1] runs against sides[0]
  int rim = -1;               // the rim, for a rim's edge
  int first_vertex = -1;
  int last_vertex = -1;

  bool is_join() const { return rim < 0; }
};

// An edge in the loop of a face: use k lies on sides[k].
struct LoopEdge {
  int edge = -1;
  int use = 0;
  bool forward = true;  // the loop runs along the edge
};

struct NetworkTopology {
  Points3 vertices_mm;  // one column a vertex: the mean of the corners that meet there
  std::vector<double> vertex_gaps_mm;  // the largest distance of those corners from it
  std::vector<NetworkEdge> edges;      // joins first, in their order, then rims' sides
  std::vector<std::vector<LoopEdge>>
      patch_loops;                               // counter-clockwise in (u, v), from corner (0, 0)
  std::vector<std::vector<LoopEdge>> rim_loops;  // counter-clockwise against the cap's normal
  std::vector<int> components;                   // the component of each patch
  int component_count = 0;
};

// The parameter on edge.sides[1] that belongs to `t` on sides[0].
double second_parameter(const NetworkEdge& edge, double t);

// Errors: what find_defect() says; two patches whose normals disagree across a join; a rim whose
// sides do not form one loop. O(size).
Result<NetworkTopology> network_topology(const SurfaceNetwork& network);

}  // namespace angiospline
