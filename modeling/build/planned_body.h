// The bodies of a plan: each branch between what its ends meet.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/warning.h"
#include "modeling/build/assembly.h"
#include "modeling/build/build_model.h"
#include "modeling/build/plan.h"
#include "modeling/network/model.h"

namespace angiospline {

// What became of a branch. More than one piece where an end is extended or the branch is a ring.
struct PlannedBody {
  std::vector<BodyPiece> pieces;
  std::vector<ClosedOpening> closed;
  std::vector<Warning> warnings;
  std::optional<FailedPart> failed;
  bool folded = false;
};

// What bodies are built between.
struct BodySurroundings {
  const SmoothedTree& tree;
  const Plan& plan;
  const BuildOptions& options;
  const std::vector<Junction>& junctions;
  const std::vector<int>& number;  // of each node's junction, or -1
  const std::vector<char>& flow;   // of each node: whether its component has an inlet
};

// The body of branch `b` along its path, from opening or end to opening or end. One that folds is
// tried with more freedom, as a loft and, where it is short, straightened; warnings say what was
// done. A free end beside an opening is cut there; a ring without junctions becomes two bodies.
// Fails by name where nothing is left of a branch between junctions that could not be built.
PlannedBody build_planned_body(const BodySurroundings& around, int b);

}  // namespace angiospline
