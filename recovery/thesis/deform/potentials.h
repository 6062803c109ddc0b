// Image potentials: edges that pull the nodes of a mesh (thesis 6.2).
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "base/result.h"
#include "recovery/thesis/deform/method.h"
#include "recovery/thesis/edges/edge_detection.h"

namespace angiospline {

// Places that pull, with how much and which way the image steps there.
struct EdgePoints {
  Points3 at_mm;
  Points3 normals;           // unit, from dark to bright: into a bright vessel
  Eigen::VectorXd strength;  // above 0

  Eigen::Index count() const { return at_mm.cols(); }
};
EdgePoints edge_points(const EdgeField& field, const ImageGrid& grid);

struct PotentialOptions {
  PotentialKind kind = PotentialKind::kGravity;
  // The thesis's 1x, 5x, 10x, 20x: the force on a node whose edges are all of full strength, at the
  // wall (gravity) or a reach away from it (springs), where a spring stretched by a voxel pulls
  // by 1.
  double strength = 10.0;
  double reach_vox = 4.0;  // at least the error of the start, or gravity does not see the wall
  // Nearer than this the pull falls linearly to 0, so that it does not jump where a node passes an
  // edge; 0 as in the thesis, whose nodes never stand quite still.
  double core_vox = 0.0;
  // Gates against edges of other things; none in the thesis. An edge beyond a gate pulls nothing.
  std::optional<double> farthest_vox;    // distance from its node
  std::optional<double> most_angle_deg;  // between the edge's dark side and the node's normal
  bool bright_inside = true;             // which side of the edges the vessel is on
};

// For each of a fixed set of points the nearest of some moving nodes (of equals any, but the same
// one for the same nodes). A point is asked again only when its nearest can have changed: with d1
// and d2 the distances of its two nearest nodes when it was last asked, that is after some node has
// gone (d2 - d1) / 2. So the answers are those of asking every time.
class NearestNodes {
 public:
  explicit NearestNodes(Points3 points) : points_(std::move(points)) {}

  // Index of the nearest column of `nodes` for each point. Requires at least two nodes and their
  // number unchanged. O(points) and for each point asked O(log nodes); on all cores.
  const std::vector<int>& update(const Points3& nodes);
  std::size_t asked() const { return asked_; }  // questions so far

 private:
  void ask(const Points3& nodes, const std::vector<int>& which);

  Points3 points_;
  Points3 last_;
  double travelled_ = 0;            // no node has moved further than this in all
  std::vector<double> good_until_;  // `travelled_` at which an answer is in doubt
  std::vector<int> nearest_;
  std::size_t asked_ = 0;
};

// The forces of edges on nodes. Each edge pulls only the one node nearest to it (one arm that grabs
// the nearest node, as the thesis has it); a node may be pulled by many. Strengths are shares of
// the strongest edge's, and are divided by the mean number of edges a node, so that forces are
// about `strength` whatever the mesh and the image. Lengths in units of `voxel_mm`.
class EdgePotentials {
 public:
  // Errors: no edges; strength, reach, or a gate not positive.
  static Result<EdgePotentials> make(EdgePoints edges, double voxel_mm,
                                     const PotentialOptions& options);

  // One force a node. `nodes_vox` are positions divided by voxel_mm; `normals` are used by the
  // angle gate only. The same on any number of threads.
  Points3 forces(const Points3& nodes_vox, const Points3& normals);

  // How many edges pulled at each node in the last forces(); and look-ups of a nearest node so far.
  const std::vector<int>& pulls_per_node() const { return pulls_; }
  std::size_t asked() const { return nearest_.asked(); }
  // How steeply the force on a node with the mean number of edges changes with its place where they
  // spread over two cores: half of the most that it can. An implicit step that counts on it is
  // stable.
  double steepness() const;

 private:
  EdgePotentials(EdgePoints edges, double voxel_mm, const PotentialOptions& options);

  EdgePoints edges_;  // in voxels
  PotentialOptions options_;
  NearestNodes nearest_;
  std::vector<int> pulls_;
};

}  // namespace angiospline
