// Which patches a junction has and how they meet: the convex hull of its branches' directions.
#pragma once

#include <vector>

#include "base/vector.h"

namespace angiospline {

// A point where the patches of three or more branches meet: one for each face of the hull.
struct JunctionPole {
  Vec3 direction = Vec3::Zero();  // unit, outward normal of the face: equally far from its branches
  std::vector<int> branches;      // counter-clockwise seen from outside
};

// The curve between two neighbouring branches: one for each edge of the hull. It runs from pole
// `from` to pole `to` with branch `a` on its left (seen from outside) and `b` on its right.
struct JunctionSaddle {
  int branch_a = -1;
  int branch_b = -1;
  int from = -1;
  int to = -1;
  int patch_a = -1;
  int patch_b = -1;
};

// The quarter between a sector of a branch's opening (u = 0) and a saddle (u = 1); the side v = 0
// ends in pole `from`, v = 1 in pole `to`. Su x Sv points outward.
struct JunctionPatch {
  int branch = -1;
  int saddle = -1;
  int from = -1;
  int to = -1;
  int next = -1;      // the patch beyond v = 1, around the same branch
  int previous = -1;  // the patch beyond v = 0
};

// Patches of a branch follow each other, counter-clockwise about its direction.
struct JunctionTopology {
  std::vector<JunctionPole> poles;
  std::vector<JunctionSaddle> saddles;
  std::vector<JunctionPatch> patches;
  std::vector<std::vector<int>> sectors;  // patches of each branch, in order
};

// The hull of unit directions: a pole for each face, a saddle for each edge, two patches for each
// edge, so 2 (poles + branches - 2) saddles less one for each merged pair of triangles. Faces whose
// normals differ by less than `merge_angle_rad` become one pole. Three directions, or directions in
// one plane, give two poles and a saddle for each neighbouring pair: for n = 3 the six patches of
// thesis 3.3.2. Requires at least three directions, no two of them equal. O(n^2).
JunctionTopology junction_topology(const std::vector<Vec3>& directions, double merge_angle_rad);

// Numbers for an m x m grid on every patch that agree where patches share an edge: nodes of a
// layout (any m) and control points of bi-quintic patches (m = 6) alike. Row i runs with u.
class SharedGrid {
 public:
  SharedGrid(const JunctionTopology& topology, int size);

  int size() const { return size_; }
  int count() const { return count_; }
  int at(int patch, int i, int j) const;

 private:
  // What at() needs of each patch.
  struct Corner {
    int saddle, from, to, next;
    bool is_a;
  };
  std::vector<Corner> patches_;
  int poles_;
  int saddles_;
  int size_;
  int count_;
};

}  // namespace angiospline
