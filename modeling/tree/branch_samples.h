// A branch as a smoothing spline takes it: samples with weights, and how many spans they deserve.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "kernel/spline/knot_vector.h"
#include "modeling/tree/centerline_tree.h"

namespace angiospline {

// One entry (of `points`: one row) a sample, in the order of the branch.
struct BranchSamples {
  Eigen::MatrixXd points;          // x, y, z in mm
  Eigen::VectorXd radii;           // mm
  Eigen::VectorXd parameters;      // length of chords from the first, mm
  Eigen::VectorXd weights;         // of the points: 1, or 0 where a sample only keeps limits
  Eigen::VectorXd radius_weights;  // 0 too where the radius is the parent's

  double length() const { return parameters(parameters.size() - 1); }
};

// The branch's points, and points between them that only the largest move knows (weight 0): a curve
// between far points must not leave the line that joins them either. A branch of very few points
// gets points with weight, for a spline to stand on. At a junction the first radius may belong to
// what comes before: then it has no weight. Requires two points or more and a length.
BranchSamples samples_of(const CenterlineBranch& branch, bool start_is_junction,
                         bool end_is_junction);

// Quintic clamped knots over the samples, even, as fine as radii and samples deserve.
KnotVector knots_for(const BranchSamples& samples);

// `spans` + 1 even breakpoints from 0 to `last`.
std::vector<double> even_breaks(double last, int spans);

}  // namespace angiospline
