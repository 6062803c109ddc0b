// The length of a plan's branches: what openings and bodies need of it, and who gets what is left.
#pragma once

#include "modeling/build/plan.h"

namespace angiospline {

// How a branch's length is shared between the openings at its ends and the body.
struct BranchRoom {
  double length = 0;  // mm, all of these
  double least = 0;   // both openings at their nearest and the shortest body
  double wanted = 0;  // both openings where they like to be and the shortest body
  double body = 0;    // that shortest body
  double radius = 0;  // mean of the openings'
  bool known = true;  // false: an end could not be measured

  bool fits() const;
};

// Requires that the nodes at both ends are measured, if they are junctions.
BranchRoom room_of(const Plan& plan, int b);

// Takes branch `b`, if it has no room for a body or that would bend too tightly, as straight
// between its junctions; if that gives no room either, as it was. kSkip: only the room is asked
// for, since the openings are not final yet. True if the branch changed: then both its nodes are
// dirty.
enum class BendCheck { kSkip, kMeasure };
bool straighten(Plan& plan, int b, const BranchRoom& room, BendCheck check);

// Shares out the length of every branch: openings and body each get their least, what is left goes
// by the wishes. Sets JunctionBranch::longest_mm. True if an opening had to come nearer than
// planned, or a branch was straightened: then there are dirty nodes. Linear in the plan.
bool tighten(Plan& plan);

}  // namespace angiospline
