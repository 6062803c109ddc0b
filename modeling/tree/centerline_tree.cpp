#include "modeling/tree/centerline_tree.h"

#include <algorithm>

#include "base/disjoint_sets.h"
#include "base/index.h"

namespace angiospline {

std::vector<std::vector<int>> branches_at_nodes(const CenterlineTree& tree) {
  std::vector<std::vector<int>> at(tree.nodes.size());
  for (std::size_t b = 0; b < tree.branches.size(); ++b) {
    at[index(tree.branches[b].from)].push_back(static_cast<int>(b));
    at[index(tree.branches[b].to)].push_back(static_cast<int>(b));
  }
  return at;
}

std::vector<int> components_of_nodes(const CenterlineTree& tree) {
  DisjointSets joined(tree.nodes.size());
  for (const CenterlineBranch& branch : tree.branches) joined.join(branch.from, branch.to);
  return joined.numbers();
}

int component_count(const CenterlineTree& tree) {
  const std::vector<int> component = components_of_nodes(tree);
  return component.empty() ? 0 : 1 + *std::max_element(component.begin(), component.end());
}

int cycle_count(const CenterlineTree& tree) {
  return static_cast<int>(tree.branches.size()) - static_cast<int>(tree.nodes.size()) +
         component_count(tree);
}

double length_mm(const CenterlineBranch& branch) {
  double sum = 0;
  for (Eigen::Index i = 1; i < branch.points_mm.cols(); ++i) {
    sum += (branch.points_mm.col(i) - branch.points_mm.col(i - 1)).norm();
  }
  return sum;
}

}  // namespace angiospline
