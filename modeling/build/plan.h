// Which junctions and bodies a smoothed tree becomes, and where the ones end and the others begin.
#pragma once

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
  // Arc length, counted from `end`, of the place nearest to `center`, if the path begins away from
  // it and passes it: no farther on than three times its distance.
  double along_nearest(BranchEnd end, const Vec3& center) const;
  // Arc length, counted from `end`, where the path from there on first comes to `distance_mm` from
  // `center`; nothing if it never does.
  std::optional<double> along_at_distance(BranchEnd end, const Vec3& center,
                                          double distance_mm) const;
};

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

  // What was found for the branches that end here, when these are others.
  void forget_openings() {
    caps_mm.clear();
    farther_mm.clear();
    bent_at.clear();
    relieved = false;
  }
  bool is_junction() const { return alive && ends.size() >= 3; }
};

// The plan keeps its own laws: every live branch has room for the openings at both its ends and a
// body between them; no node has exactly two ends of different branches.
class Plan {
 public:
  // Merges, drops and extends until every branch has room. Parallel over nodes, linear in the tree.
  Plan(const SmoothedTree& tree, const JunctionOptions& options);

  const std::vector<PlannedNode>& nodes() const { return nodes_; }
  const std::vector<PlannedBranch>& branches() const { return branches_; }
  const std::vector<Warning>& warnings() const { return warnings_; }

  // After a junction failed: look for directions farther out, or merge it with the nearest junction
  // no farther than `radii` of the branch between them. False if there is none. Then settle()
  // again.
  void reach_farther(int node, double factor);
  void move_forward(int node, double radii);
  bool merge_with_nearest(int node, double radii);
  // After a body folded: its two junctions become one. False if it has not two.
  bool merge_along(int branch);
  void settle();

  // Where openings still strain the bodies behind them, branches may bend inside their junctions:
  // their rays begin on their paths. find_bends() looks for ways to do so, at most kAlternatives a
  // node, the best first. bend() takes of each node the first that is not refused and leaves every
  // branch its room; `refused` (one entry a node): so many of its ways are not to be taken. It
  // returns the nodes that have changed, and is asked once only: again of a copy made before.
  static constexpr int kAlternatives = 4;
  void find_bends();
  std::vector<int> bend(const std::vector<int>& refused);

 private:
  struct Room;
  // In plan_bends.cpp.
  struct Eased;
  double cost_at(const PlannedNode& node, std::size_t slot) const;
  std::vector<double> costs_of(const PlannedNode& node) const;
  void ease(Eased best, std::vector<Eased>& found) const;
  std::vector<PlannedNode> eased(const PlannedNode& node) const;
  // In plan_measures.cpp.
  void measure(PlannedNode& node) const;
  void aim(PlannedNode& node, const std::vector<double>& distance_mm) const;
  bool find_distances(PlannedNode& node, std::vector<double>& distance_mm) const;
  double bend_behind(const PlannedNode& node, std::size_t slot, double along) const;
  double strain_at(const PlannedNode& node, std::size_t slot) const;
  double overlap_behind(const PlannedNode& node, std::size_t i, std::size_t j) const;
  double strain_of(const PlannedNode& node) const;
  void relieve(PlannedNode& node) const;
  std::vector<Vec3> other_centres(const PlannedNode& node) const;
  Room room_of(int branch) const;
  bool has_room(int branch) const;
  double end_along(int branch, bool at_end, bool wanted) const;
  double planned_mm(BranchEnd end) const;
  double bend_of(int branch) const;
  bool share_room(int branch);
  bool tighten();
  bool drop_twins(int node);
  bool drop_inner_loop(int node);
  void extend(int branch, double missing_mm);
  void drop(int branch, const std::string& why);
  void merge(int branch, double fits, const std::string& why);
  bool straighten(int branch, const Room& room, double bend);
  void make_room(int branch, const Room& room);
  void join_through(int node);
  void detach(BranchEnd end);
  PlannedNode& node_at(BranchEnd end);
  const PlannedNode& node_at(BranchEnd end) const;
  int slot_of(BranchEnd end) const;

  JunctionOptions options_;
  std::vector<PlannedNode> nodes_;
  std::vector<PlannedBranch> branches_;
  std::vector<std::vector<PlannedNode>> bends_;  // other ways to plan each node
  std::vector<char> dirty_;                      // nodes to measure again
  std::vector<Warning> warnings_;
};

}  // namespace angiospline
