// A model: the surfaces, the tree they came from, and what a reader of the file should know.
#pragma once

#include <string>
#include <vector>

#include "modeling/centerline_tree.h"
#include "modeling/surface_network.h"

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
  std::vector<std::string> warnings;
  std::vector<FailedPart> failed;
};

}  // namespace angiospline
