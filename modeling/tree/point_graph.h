// Points joined by edges, as files and skeletons give them, and their way to a centerline tree.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "base/result.h"
#include "modeling/tree/centerline_tree.h"

namespace angiospline {

struct GraphPoint {
  std::string name;  // the input's own id: nodes and branches are named after it
  Vec3 position_mm = Vec3::Zero();
  double radius_mm = 0.0;
};

struct PointGraph {
  std::vector<GraphPoint> points;
  std::vector<std::pair<int, int>> edges;  // in the direction of the flow where that is known
  std::vector<int> roots;                  // where flow enters, if the input says so

  // Radii of the edges, where the input has them instead of the points': empty, or one for each
  // edge. A point between two edges of a branch gets their mean.
  std::vector<double> edge_radii_mm;

  // The input's own names of lines: empty, or for each edge the index of its name in `line_names`.
  std::vector<int> line_of_edge;
  std::vector<std::string> line_names;
};

// The tree whose nodes are the ends and junctions of the graph and whose branches are the chains
// between them, oriented away from the inlets. In this order:
//   1. points at exactly the same position become one where an edge joins them, where they hang on
//      the same point (a doubled edge), or where one of them is an end (that closes loops); what
//      was joined is listed in `assumptions`. Each branch keeps the radius of its copy;
//   2. points without edges and doubled edges are dropped;
//   3. an inlet is a root that is an end; a component without one gets its end of largest radius,
//      and an assumption says so; a component without ends has none.
// A node bears its point's name, a branch "<from>_<to>" ("<from>_<to>_via_<p>" with its first inner
// point p where several join the same nodes); a line's name is taken instead where the branch is
// the only one of that line and has no edge of another. A ring without junctions is one branch from
// and to its first point. Errors: no edge of positive length. Requires indices in range, finite
// positions, positive radii. O(n log n) time, O(n) memory.
Result<CenterlineTree> tree_from_points(const PointGraph& graph);

}  // namespace angiospline
