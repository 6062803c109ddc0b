// Which junctions and bodies a smoothed tree becomes, and where the ones end and the others begin.
#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "base/warning.h"
#include "modeling/junction/junction.h"
#include "modeling/tree/smooth_centerlines.h"

namespace angiospline {

// One end of a branch: `at_end` is where its path ends, otherwise where it begins.
struct BranchEnd {
  int branch = -1;
  bool at_end = false;

  BranchEnd opposite() const { return {branch, !at_end}; }
};

// A branch as the plan sees it: samples of its smoothed path. A branch that has left the plan (it
// was dropped, merged into a junction or joined to another) keeps its place with `alive` false.
struct PlannedBranch {
  std::string name;
  Eigen::Matrix4Xd samples;      // x, y, z, radius in mm
  std::vector<double> along_mm;  // arc length at each sample
  int from = -1;                 // nodes of the plan
  int to = -1;
  bool straight = false;        // too short to bend: runs straight between its two nodes
  bool tried_straight = false;  // it was, and had too little room
  bool alive = true;

  double length_mm() const { return along_mm.back(); }
  Vec4 at(double along) const;  // linear between samples, held beyond the ends
  // The place `along` from one of its ends.
  Vec4 at_from(BranchEnd end, double along) const {
    return at(end.at_end ? length_mm() - along : along);
  }
  // Arc length, counted from `end`, of the place nearest to `center`, if the path begins away from
  // it and passes it: no farther on than three times its distance.
  double along_nearest(BranchEnd end, const Vec3& center) const;
  // Arc length, counted from `end`, where the path from there on first comes to `distance_mm` from
  // `center`; nothing if it never does.
  std::optional<double> along_at_distance(BranchEnd end, const Vec3& center,
                                          double distance_mm) const;
};

// Sets along_mm from the samples.
void measure_length(PlannedBranch& branch);

// A branch that became part of a junction, and the share of the length it needed that it had; 0 if
// it was not for its length.
struct AbsorbedBranch {
  int branch = -1;
  double fits = 0.0;
};

// Free end (one branch end), ring (two ends of one branch) or junction (three or more).
struct PlannedNode {
  std::string name;  // of merged nodes: "a+b"
  Vec3 center_mm = Vec3::Zero();
  std::vector<BranchEnd> ends;
  bool alive = true;
  bool inlet = false;
  bool merged = false;                   // of two junctions or more
  std::vector<AbsorbedBranch> absorbed;  // that lay between these

  // Of a junction, once it is measured; in the order of `ends`.
  JunctionSpec spec;
  std::vector<double> wanted_mm;  // distance of each opening with room to spare
  std::vector<double> least_mm;   // and with the least margin and blend
  std::vector<double> meets_mm;   // distance from which on the body follows the branch's path
  std::vector<Vec3> begins_mm;    // from the centre to where each branch's ray begins
  std::vector<double> caps_mm;    // the branch leaves no room for an opening farther out
  std::optional<Error> error;     // why no openings could be found
  double reach = 1.0;             // directions are taken at this multiple of the openings' distance
  std::vector<double> farther_mm;  // openings lie at least so far out
  std::vector<double> bent_at;     // each branch's ray begins at this share of the way to its
                                   // opening, on its path; 0: in the centre
  bool relieved = false;  // its centre and distances were chosen by what they ask of bodies

  // Where the body of this slot begins to follow its path.
  double follows_mm(std::size_t slot) const { return std::max(wanted_mm[slot], meets_mm[slot]); }
  // What was found for the branches that end here, when these are others.
  void forget_openings() {
    caps_mm.clear();
    farther_mm.clear();
    bent_at.clear();
    relieved = false;
  }
  bool is_junction() const { return alive && ends.size() >= 3; }
};

// A plan is a value; the steps that make and change it are functions of their own headers:
// modeling/build/plan_measures.h (openings), plan_relief.h (what they ask of bodies), plan_room.h
// (the length of branches), plan_edits.h (merging, dropping, extending), plan_settling.h (all of
// these until nothing is left to do) and plan_bends.h (branches that bend inside junctions).
// Laws of a settled plan: every live branch has room for the openings at both its ends and a body
// between them; no node has exactly two ends of different branches.
struct Plan {
  JunctionOptions options;
  std::vector<PlannedNode> nodes;
  std::vector<PlannedBranch> branches;
  std::vector<char> dirty;  // nodes to measure again
  std::vector<Warning> warnings;
  std::vector<std::vector<PlannedNode>> bends;  // other ways to plan each node, the best first

  const PlannedBranch& branch(BranchEnd end) const;
  PlannedNode& node(BranchEnd end);
  const PlannedNode& node(BranchEnd end) const;
  std::size_t slot(BranchEnd end) const;  // of its node. Requires that the branch ends there
};

// The plan before anything is measured: nodes and branches as the tree has them, all of them dirty.
// Linear in the tree, parallel over branches.
Plan unsettled_plan(const SmoothedTree& tree, const JunctionOptions& options);

// The settled plan: merges, drops and extends until every branch has room. Parallel over nodes,
// linear in the tree.
Plan make_plan(const SmoothedTree& tree, const JunctionOptions& options);

}  // namespace angiospline
