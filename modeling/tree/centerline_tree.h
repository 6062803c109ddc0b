// The value at which the two ways in meet: branches with centerlines and radii, joined at nodes.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/vector.h"

namespace angiospline {

// An end (one branch) or a junction (two or more). `name` derives from the input (an SWC id, a
// skeleton node) so that it survives a re-run and small edits of the input.
struct CenterlineNode {
  std::string name;
  Vec3 position_mm = Vec3::Zero();
};

// A polyline from node `from` to node `to`; the first and last points are the nodes' positions.
struct CenterlineBranch {
  std::string name;
  int from = -1;
  int to = -1;
  Points3 points_mm;         // one column a point, at least two
  Eigen::VectorXd radii_mm;  // one for each point, positive
};

// A graph of branches: several components and loops are legal (the name follows the field's habit).
struct CenterlineTree {
  std::vector<CenterlineNode> nodes;
  std::vector<CenterlineBranch> branches;
  std::vector<int> inlets;               // nodes where flow enters; each is an end; may be empty
  std::vector<std::string> assumptions;  // what was assumed on the way in: unit, merged lines ...
  std::string source;                    // where it came from: a file name
};

// branches_at[n]: the branches that end at node n, in order of index; a loop onto itself is listed
// twice.
std::vector<std::vector<int>> branches_at_nodes(const CenterlineTree& tree);

// Number of independent cycles: branches - nodes + components.
int cycle_count(const CenterlineTree& tree);
int component_count(const CenterlineTree& tree);

// The component (0-based, in order of the lowest node) of each node.
std::vector<int> components_of_nodes(const CenterlineTree& tree);

// Length of a branch's polyline.
double length_mm(const CenterlineBranch& branch);

}  // namespace angiospline
