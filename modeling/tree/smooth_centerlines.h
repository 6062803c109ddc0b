// From jagged input to smooth branches: cleaning, then penalised splines through points and radii.
#pragma once

#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "base/warning.h"
#include "kernel/spline/curve.h"
#include "modeling/tree/centerline_tree.h"

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
  std::vector<Warning> warnings;

  // What has become of the input's points can be told from these: the points of each branch (x, y,
  // z, radius) before anything was moved; empty: as in `tree`. And the paths before vessels were
  // kept apart (modeling/tree/keep_apart.h); empty: none was asked to.
  std::vector<Eigen::Matrix4Xd> given;
  std::vector<BSplineCurve<4>> before_clearance;
};

// Cleans the tree (modeling/tree/clean_tree.h) and smooths its branches (docs/centerlines.md):
// penalised quintic splines through points and logarithms of radii, their strength chosen by
// restricted likelihood, pooled over the tree; nodes placed by all their branches together. No
// given point moves farther than `largest_move`; within that, bends are eased until curvature times
// radius is below 0.8. Where that is not enough the radius gives way, down to a fifth; a warning
// names the branch. Warnings also name what cleaning dropped and the vessels that overlap. A ring
// without junctions ends at its node, where its tangent may turn. Errors: no branch of positive
// length is left; stopped on request. O(points log points).
Result<SmoothedTree> smooth_centerlines(const CenterlineTree& tree,
                                        const SmoothingOptions& options = {},
                                        const Progress& progress = {});

}  // namespace angiospline
