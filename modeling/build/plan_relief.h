// What the openings of a junction ask of the bodies behind them, and plans of it that ask for less.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "modeling/build/plan.h"

namespace angiospline {

// An opening of a measured node and the branch behind it. Holds references to the plan and node.
struct OpeningView {
  BranchEnd end;
  const PlannedBranch& branch;
  const JunctionBranch& opening;
  double distance_mm;           // from the centre, at which the body begins to follow its path
  std::optional<double> along;  // arc length from `end` of that place; nothing if there is none

  Vec4 at(double s) const { return branch.at_from(end, s); }
};
OpeningView view_of(const Plan& plan, const PlannedNode& node, std::size_t slot);

// The strain of one opening: the angle by which its path turns away right behind it, by how much a
// body there bends beyond kTightestBend, and what the chord leaves of the branch. 0 on straight
// branches.
double strain_at(const Plan& plan, const PlannedNode& node, std::size_t slot);

// The largest strain of a measured node's openings; lumens that overlap behind two of them count as
// strain too, and a node without openings as ten.
double strain_of(const Plan& plan, const PlannedNode& node);

// Places from which branches that leave together may part better: where they have gone some way.
std::vector<Vec3> other_centres(const Plan& plan, const PlannedNode& node);

// The measured node as it is, or, if its strain is worth it, the plan of it with the least strain:
// its centre moved to where branches part, openings moved out or in. O(openings x ways) measures.
PlannedNode relieved(const Plan& plan, PlannedNode node);

}  // namespace angiospline
