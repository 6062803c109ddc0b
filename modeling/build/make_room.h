// Where junctions swallow each other: vessels are thinned until the branches between have their
// length.
#pragma once

#include <string>
#include <vector>

#include "modeling/build/plan.h"
#include "modeling/tree/smooth_centerlines.h"

namespace angiospline {

struct RoomOptions {
  std::size_t most_branches = 5;  // of a part into which a junction is cut
  double thinnest = 0.4;          // no vessel is thinned below this share of its radius
};

// Junctions with too little length between them become one, whose openings lie farther out and
// leave the next branch too little length: in trees of short thick branches this runs away. Here
// such a junction is cut again where the least is lacking, and there vessels are thinned: over two
// local radii along the tree, and less and less over three more.
class RoomMaker {
 public:
  // Keeps a copy of the tree. Linear in the tree.
  explicit RoomMaker(SmoothedTree tree, const RoomOptions& options = {});

  // The branches that `node` absorbed and that lack the least become branches again, until no part
  // has more than most_branches; of a node that has no more, all. Each of the vessels at their ends
  // is thinned by the share of the length that is lacking, a fifth at most: it is called again if
  // that did not do. False if no vessel there may become thinner.
  // Requires a node of a plan of this tree.
  bool cut(const PlannedNode& node);

  // The tree, thinned where it was asked for, its radii too; a warning names each branch that was
  // and by how much. Unchanged where nothing was.
  SmoothedTree tree();

 private:
  std::vector<std::pair<int, double>> near(int node) const;
  double share_at(std::size_t branch, double along) const;
  void thin(std::size_t branch, SmoothedTree& tree) const;

  // What a node asks of an end of a branch: the share of the radius to keep, and how many radii of
  // way already lie between.
  struct Request {
    double share;
    double away;
  };

  SmoothedTree given_;
  RoomOptions options_;
  std::vector<std::vector<int>> at_;            // branches at each node
  std::vector<std::vector<double>> ways_;       // along each branch, in local radii, at even places
  std::vector<double> shares_;                  // of the radius that vessels at each node keep
  std::vector<std::vector<Request>> requests_;  // at each node
};

}  // namespace angiospline
