#include "kernel/geometry/triangle_tree.h"

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>

#include <Eigen/Geometry>

#include "base/contract.h"

namespace angiospline {
namespace {

constexpr int kLeafSize = 4;

double squared_distance_to_box(const Vec3& p, const Vec3& low, const Vec3& high) {
  return (low - p).cwiseMax(p - high).cwiseMax(0.0).squaredNorm();
}

Vec3 nearest_on_segment(const Vec3& p, const Vec3& a, const Vec3& b) {
  const Vec3 d = b - a;
  const double length = d.squaredNorm();
  return length > 0 ? Vec3(a + std::clamp((p - a).dot(d) / length, 0.0, 1.0) * d) : a;
}

}  // namespace

Vec3 nearest_on_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a;
  const Vec3 ac = c - a;
  const Vec3 n = ab.cross(ac);
  const double area = n.squaredNorm();
  // A sliver below this sine is its sides, to within the same fraction of its length; the normal
  // of a thinner one would be noise.
  constexpr double kLeastSine = 1e-10;
  if (area > kLeastSine * kLeastSine * ab.squaredNorm() * ac.squaredNorm()) {
    // Barycentric coordinates of the foot on the plane; inside, it is the answer.
    const Vec3 ap = p - a;
    const double v = ap.cross(ac).dot(n);
    const double w = ab.cross(ap).dot(n);
    if (v >= 0 && w >= 0 && v + w <= area) return a + (v * ab + w * ac) / area;
  }

  Vec3 best = nearest_on_segment(p, a, b);
  for (const Vec3& q : {nearest_on_segment(p, b, c), nearest_on_segment(p, c, a)}) {
    if ((q - p).squaredNorm() < (best - p).squaredNorm()) best = q;
  }
  return best;
}

TriangleTree::TriangleTree(const TriangleMesh& mesh) : mesh_(mesh) {
  EXPECTS(mesh.triangles.cols() > 0);
  order_.resize(static_cast<std::size_t>(mesh.triangles.cols()));
  std::iota(order_.begin(), order_.end(), 0);
  Points3 centers(3, mesh.triangles.cols());
  for (Eigen::Index t = 0; t < centers.cols(); ++t) {
    centers.col(t) =
        (mesh.points_mm.col(mesh.triangles(0, t)) + mesh.points_mm.col(mesh.triangles(1, t)) +
         mesh.points_mm.col(mesh.triangles(2, t))) /
        3;
  }
  nodes_.push_back({Vec3::Zero(), Vec3::Zero(), 0, static_cast<int>(order_.size()), -1});
  for (int node = 0; node < static_cast<int>(nodes_.size()); ++node) split(node, centers);
  // Children come after their parents: boxes grow from the back.
  for (auto node = nodes_.rbegin(); node != nodes_.rend(); ++node) fit_box(*node);
}

void TriangleTree::split(int node, const Points3& centers) {
  const int first = nodes_[static_cast<std::size_t>(node)].first;
  const int last = nodes_[static_cast<std::size_t>(node)].last;
  if (last - first <= kLeafSize) return;

  Vec3 low = centers.col(order_[static_cast<std::size_t>(first)]);
  Vec3 high = low;
  for (int k = first; k < last; ++k) {
    low = low.cwiseMin(centers.col(order_[static_cast<std::size_t>(k)]));
    high = high.cwiseMax(centers.col(order_[static_cast<std::size_t>(k)]));
  }
  Eigen::Index axis = 0;
  (high - low).maxCoeff(&axis);

  // At the median; equal places go by number, so that the tree is the same on every machine.
  const int middle = first + (last - first) / 2;
  std::nth_element(order_.begin() + first, order_.begin() + middle, order_.begin() + last,
                   [&](int a, int b) {
                     const double ca = centers(axis, a);
                     const double cb = centers(axis, b);
                     return ca != cb ? ca < cb : a < b;
                   });

  nodes_[static_cast<std::size_t>(node)].left = static_cast<int>(nodes_.size());
  nodes_.push_back({Vec3::Zero(), Vec3::Zero(), first, middle, -1});
  nodes_.push_back({Vec3::Zero(), Vec3::Zero(), middle, last, -1});
}

void TriangleTree::fit_box(Node& node) const {
  if (node.left >= 0) {
    const Node& a = nodes_[static_cast<std::size_t>(node.left)];
    const Node& b = nodes_[static_cast<std::size_t>(node.left) + 1];
    node.low = a.low.cwiseMin(b.low);
    node.high = a.high.cwiseMax(b.high);
    return;
  }
  node.low = Vec3::Constant(std::numeric_limits<double>::infinity());
  node.high = -node.low;
  for (int k = node.first; k < node.last; ++k) {
    for (int corner = 0; corner < 3; ++corner) {
      const Vec3 p =
          mesh_.points_mm.col(mesh_.triangles(corner, order_[static_cast<std::size_t>(k)]));
      node.low = node.low.cwiseMin(p);
      node.high = node.high.cwiseMax(p);
    }
  }
}

void TriangleTree::look_at(int triangle, const Vec3& p, NearestTrianglePoint& best) const {
  const Vec3 q = nearest_on_triangle(p, mesh_.points_mm.col(mesh_.triangles(0, triangle)),
                                     mesh_.points_mm.col(mesh_.triangles(1, triangle)),
                                     mesh_.points_mm.col(mesh_.triangles(2, triangle)));
  const double squared = (q - p).squaredNorm();
  if (squared < best.squared_distance_mm2) best = {q, triangle, squared};
}

NearestTrianglePoint TriangleTree::nearest(const Vec3& p, int hint) const {
  NearestTrianglePoint best;
  best.squared_distance_mm2 = std::numeric_limits<double>::infinity();
  if (hint >= 0) look_at(hint, p, best);

  // Halving leaves at most 32 levels, and each adds one node to the stack.
  struct Entry {
    int node;
    double squared;
  };
  std::array<Entry, 64> stack;
  std::size_t depth = 0;
  stack[depth++] = {0, 0.0};

  while (depth > 0) {
    const Entry entry = stack[--depth];
    if (entry.squared > best.squared_distance_mm2) continue;
    const Node& node = nodes_[static_cast<std::size_t>(entry.node)];
    if (node.left < 0) {
      for (int k = node.first; k < node.last; ++k) {
        look_at(order_[static_cast<std::size_t>(k)], p, best);
      }
      continue;
    }

    const auto entry_of = [&](int child) {
      const Node& c = nodes_[static_cast<std::size_t>(child)];
      return Entry{child, squared_distance_to_box(p, c.low, c.high)};
    };
    Entry near = entry_of(node.left);
    Entry far = entry_of(node.left + 1);
    if (far.squared < near.squared) std::swap(near, far);
    stack[depth++] = far;
    stack[depth++] = near;
  }
  return best;
}

}  // namespace angiospline
