// A model: the surfaces, the tree they came from, and what a reader of the file should know.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/warning.h"
#include "modeling/network/surface_network.h"
#include "modeling/tree/centerline_tree.h"

namespace angiospline {

// A part of the tree that could not be modelled, and why.
struct FailedPart {
  std::string name;
  std::string why;
};

// Everything the native file keeps. Lengths are millimetres.
struct Model {
  std::string name;
  SurfaceNetwork network;
  CenterlineTree tree;
  std::vector<std::string> assumptions;
  std::vector<Warning> warnings;
  std::vector<FailedPart> failed;
};

// The first broken invariant of the tree or of the network: nodes in range, at least two finite
// points a branch with a positive radius each, and find_defect(network). An empty tree is legal.
std::optional<Error> find_defect(const CenterlineTree& tree);
std::optional<Error> find_defect(const Model& model);

}  // namespace angiospline
