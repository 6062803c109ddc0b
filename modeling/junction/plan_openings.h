// How far from its centre a junction ends along each branch.
#pragma once

#include <vector>

#include "base/result.h"
#include "modeling/junction/junction.h"
#include "modeling/layout/target.h"

namespace angiospline {

// Distances of the openings in units of `unit_mm`, and the blend they were
// found with (smaller than the one asked for where a branch is short).
struct OpeningPlan {
  double unit_mm = 1.0;  // the largest radius: all later work is done in this unit
  double blend = 0.0;
  double rounding = 0.0;
  std::vector<TargetBranch> branches;
  std::vector<double> distances;  // along each branch, from where it begins

  Vec3 opening(std::size_t branch) const {
    return branches[branch].start + distances[branch] * branches[branch].direction;
  }
  // Unit, from the centre to each opening: what the junction's topology
  // follows.
  std::vector<Vec3> directions() const;
};

// Where the other branches' share of the target falls to a twentieth all round
// the branch's circle, plus a margin. Branches shorter than that first lose
// margin (down to 0.3 radii), then all branches lose blend (down to a third).
// Errors: see opening_distances_mm in junction.h.
Result<OpeningPlan> plan_openings(const JunctionSpec& spec, const JunctionOptions& options);

}  // namespace angiospline
