// How well one set of centerlines covers another (Schaap et al., "Standardized evaluation
// methodology and reference database for evaluating coronary artery centerline extraction
// algorithms", Medical Image Analysis 2009).
#pragma once

#include "modeling/tree/centerline_tree.h"

namespace angiospline {

// Both trees are sampled evenly along their branches, so that shares are shares of length.
struct CenterlineOverlap {
  double overlap = 1;  // of both trees together; the paper's OV
  double found = 1;    // share of the truth that has a point of the result within its radius
  double correct = 1;  // share of the result that lies within the radius of the nearest true point
  double offset_mm = 0;  // mean distance of the correct part from the truth; the paper's AI
  double truth_length_mm = 0;
  double result_length_mm = 0;
};

// Distances run between sampled points, a quarter of the truth's smallest radius apart (but at most
// a million in all), so that `offset_mm` errs by at most an eighth of that radius. Both trees
// empty: all ones; one of them: overlap 0. O(n log n) in the points.
CenterlineOverlap centerline_overlap(const CenterlineTree& truth, const CenterlineTree& result);

}  // namespace angiospline
