// Exact distances to a triangle mesh.
#pragma once

#include <vector>

#include "base/vector.h"
#include "kernel/geometry/triangle_mesh.h"

namespace angiospline {

// The point of triangle (a, b, c) nearest to p; a degenerate triangle is its sides.
// Reference: Ericson, Real-Time Collision Detection (2005), 5.1.5.
Vec3 nearest_on_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c);

struct NearestTrianglePoint {
  Vec3 point_mm = Vec3::Zero();
  int triangle = -1;
  double squared_distance_mm2 = 0.0;
};

// A hierarchy of boxes over the triangles of a mesh, which must outlive it. Built in O(n log n),
// asked in O(log n) for points near the mesh; safe to ask from several threads.
class TriangleTree {
 public:
  // Requires a sound mesh with at least one triangle.
  explicit TriangleTree(const TriangleMesh& mesh);

  // The nearest point of the mesh; of several at one distance, one that is always the same for the
  // same hint. `hint`, a triangle that may be near, saves time.
  NearestTrianglePoint nearest(const Vec3& p, int hint = -1) const;

 private:
  // A node covers order_[first .. last); its children, if any, are at `left` and `left` + 1.
  struct Node {
    Vec3 low;
    Vec3 high;
    int first;
    int last;
    int left;
  };

  void look_at(int triangle, const Vec3& p, NearestTrianglePoint& best) const;
  void split(int node, const Points3& centers);
  void fit_box(Node& node) const;

  const TriangleMesh& mesh_;
  std::vector<int> order_;
  std::vector<Node> nodes_;
};

}  // namespace angiospline
