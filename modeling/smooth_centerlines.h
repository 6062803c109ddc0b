// From jagged input to smooth branches: cleaning, then penalised splines through points and radii.
#pragma once

#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "kernel/curve.h"
#include "modeling/centerline_tree.h"

namespace angiospline {

struct SmoothingOptions {
  double largest_move = 0.5;  // no point moves farther, in local radii
};

// A cleaned tree and, for each of its branches, one smooth path.
struct SmoothedTree {
  CenterlineTree tree;  // names survive cleaning where their node or branch does

  // paths[b](s) = (x, y, z, radius) in mm; s runs over [0, length], nearly arc length, from node
  // `from` to node `to` of branch b; quintic, at least C2; ends at the nodes' positions.
  std::vector<BSplineCurve<4>> paths;

  double largest_move_mm = 0.0;
  std::vector<std::string> warnings;
};

// Removes zero-length edges and duplicate points, joins branches at nodes of degree two, drops what
// has no length, then smooths. Errors: no branch of positive length is left.
Result<SmoothedTree> smooth_centerlines(const CenterlineTree& tree,
                                        const SmoothingOptions& options = {},
                                        const Progress& progress = {});

}  // namespace angiospline
