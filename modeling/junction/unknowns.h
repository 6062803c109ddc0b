// What may move in a junction: control points, freely or along their branch's axis.
#pragma once

#include <vector>

#include "base/vector.h"
#include "modeling/layout/layout.h"
#include "modeling/layout/topology.h"

namespace angiospline {

// How one control point follows the vector of unknowns. Opening rows are fixed; the row next to an
// opening slides: point = opening point - (unknown) * axis, so that the tangent plane along the
// opening contains the axis; all others move freely.
struct ControlSlot {
  int first = -1;             // index of its first unknown
  int count = 0;              // 0 fixed, 1 sliding, 3 free
  Vec3 along = Vec3::Zero();  // of a sliding point: minus the axis
};

// The control net of a junction: bi-quintic patches on shared points.
struct JunctionNet {
  SharedGrid grid;  // 6 x 6 points a patch
  Points3 points;
  std::vector<ControlSlot> slots;  // one a point
  std::vector<double> scale;       // local radius of each point: the smallest of its branches'
  int unknowns = 0;

  // Moves every point by its part of `move`.
  void apply(const Eigen::VectorXd& move);
};

// The net with its opening rows in place and everything else at the layout's nodes: a start only.
JunctionNet start_net(const JunctionTopology& topology, const JunctionLayout& layout);

}  // namespace angiospline
