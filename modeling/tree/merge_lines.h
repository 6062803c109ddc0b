// Lines that overlap or touch, as VMTK and SimVascular write them, merged into one graph.
#pragma once

#include <string>
#include <vector>

#include "modeling/tree/point_graph.h"

namespace angiospline {

struct CenterlineLine {
  std::string name;
  Points3 points_mm;  // one column a point
  Eigen::VectorXd radii_mm;
};

struct MergeOptions {
  double overlap = 0.25;    // lines closer than this part of the local radius are the same vessel
  bool attach_ends = true;  // an end inside another line's lumen is joined to that line
};

struct MergedLines {
  PointGraph graph;     // a root at the first point of the first line
  int overlapping = 0;  // lines of which a part was another's
  int attached = 0;     // ends joined to the line whose lumen they lie in
  int dropped = 0;      // lines that lie within others altogether
};

// Takes the lines in their order. Of a line only what departs from those before it is added, joined
// where it leaves and where it returns (loops stay). A departure that stays within twice `overlap`
// is none; neither is an encounter shorter than a radius with a line in passing. Where points lie
// farther apart than a radius others are put between them. A point's name is its line's with its
// number, counted from 1. Requires lines of at least two points, finite, with positive radii. O(n
// log n) for n points.
MergedLines merge_lines(const std::vector<CenterlineLine>& lines, const MergeOptions& options = {});

}  // namespace angiospline
