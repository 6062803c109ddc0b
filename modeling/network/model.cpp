#include "modeling/network/model.h"

#include <cmath>

namespace angiospline {
namespace {

Error defect(std::string what, std::string where, std::string value, std::string rule) {
  return {ErrorKind::kBadInput, std::move(what), std::move(where), std::move(value),
          std::move(rule)};
}

std::optional<Error> find_branch_defect(const CenterlineBranch& branch, int nodes) {
  const std::string where = "branch " + branch.name;
  for (const int node : {branch.from, branch.to}) {
    if (node < 0 || node >= nodes) {
      return defect("branch names a node that is not there", where, std::to_string(node),
                    "0 to " + std::to_string(nodes - 1));
    }
  }

  if (branch.points_mm.cols() < 2) {
    return defect("branch has too few points", where, std::to_string(branch.points_mm.cols()),
                  "at least two");
  }
  if (branch.radii_mm.size() != branch.points_mm.cols()) {
    return defect("wrong number of radii", where, std::to_string(branch.radii_mm.size()),
                  "one for each point");
  }

  for (Eigen::Index k = 0; k < branch.points_mm.cols(); ++k) {
    const double radius = branch.radii_mm[k];
    if (!branch.points_mm.col(k).allFinite()) {
      return defect("coordinate is not finite", where + ", point " + std::to_string(k), {},
                    "coordinates are finite");
    }
    if (!(radius > 0) || !std::isfinite(radius)) {
      return defect("radius is not positive", where + ", point " + std::to_string(k),
                    std::to_string(radius), "radii are positive and finite");
    }
  }
  return std::nullopt;
}

}  // namespace

std::optional<Error> find_defect(const CenterlineTree& tree) {
  const int nodes = static_cast<int>(tree.nodes.size());
  for (const CenterlineNode& node : tree.nodes) {
    if (!node.position_mm.allFinite()) {
      return defect("coordinate is not finite", "node " + node.name, {}, "coordinates are finite");
    }
  }
  for (const CenterlineBranch& branch : tree.branches) {
    if (auto error = find_branch_defect(branch, nodes)) return error;
  }
  for (const int inlet : tree.inlets) {
    if (inlet < 0 || inlet >= nodes) {
      return defect("inlet names a node that is not there", "tree", std::to_string(inlet),
                    "0 to " + std::to_string(nodes - 1));
    }
  }
  return std::nullopt;
}

std::optional<Error> find_defect(const Model& model) {
  if (auto error = find_defect(model.tree)) return error;
  return find_defect(model.network);
}

}  // namespace angiospline
