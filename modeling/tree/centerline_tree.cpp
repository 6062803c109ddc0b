#include "modeling/tree/centerline_tree.h"

#include <algorithm>
#include <numeric>

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
  std::vector<int> parent(tree.nodes.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int n) {
    while (parent[index(n)] != n) n = parent[index(n)] = parent[index(parent[index(n)])];
    return n;
  };
  for (const CenterlineBranch& branch : tree.branches) {
    const int a = root(branch.from);
    const int b = root(branch.to);
    parent[index(std::max(a, b))] = std::min(a, b);  // the lowest node stays the root
  }
  std::vector<int> component(tree.nodes.size(), -1);
  int count = 0;
  for (std::size_t n = 0; n < tree.nodes.size(); ++n) {
    const int r = root(static_cast<int>(n));
    if (component[index(r)] < 0) component[index(r)] = count++;
    component[n] = component[index(r)];
  }
  return component;
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
