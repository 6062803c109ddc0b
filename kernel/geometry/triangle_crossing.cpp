#include "kernel/geometry/triangle_crossing.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>

#include <Eigen/Geometry>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

namespace angiospline {
namespace {

using Triangle = std::array<int, 3>;
using Corners = std::array<Vec3, 3>;

constexpr double kTouch = 1e-9;  // of a triangle's size: nearer than this is touching
constexpr std::size_t kLeaf = 4;

double size_of(const Corners& t) {
  return std::max({(t[1] - t[0]).norm(), (t[2] - t[1]).norm(), (t[0] - t[2]).norm()});
}

// Where the open segment pq goes through the inside of the triangle.
std::optional<Vec3> pierce(const Vec3& p, const Vec3& q, const Corners& t) {
  Vec3 normal = (t[1] - t[0]).cross(t[2] - t[0]);
  const double double_area = normal.norm();
  const double size = size_of(t);
  if (!(double_area > kTouch * size * size)) return std::nullopt;  // a sliver without a plane
  normal /= double_area;
  const double dp = normal.dot(p - t[0]);
  const double dq = normal.dot(q - t[0]);
  const double touch = kTouch * std::max(size, (q - p).norm());
  if (!((dp > touch && dq < -touch) || (dp < -touch && dq > touch))) return std::nullopt;
  const Vec3 x = p + (q - p) * (dp / (dp - dq));
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3& a = t[k];
    const Vec3& b = t[(k + 1) % 3];
    if (!((b - a).cross(x - a).dot(normal) > kTouch * double_area)) return std::nullopt;
  }
  return x;
}

// Whether two triangles in one plane overlap: no side of either separates them.
bool overlap_in_plane(const Corners& a, const Corners& b) {
  const Vec3 normal = (a[1] - a[0]).cross(a[2] - a[0]).normalized();
  const double touch = kTouch * std::max(size_of(a), size_of(b));
  for (const Vec3& p : b) {
    if (std::abs(normal.dot(p - a[0])) > touch) return false;
  }
  const auto separates = [&](const Corners& t, const Corners& other) {
    const Vec3 up = (t[1] - t[0]).cross(t[2] - t[0]);
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 out = (t[(k + 1) % 3] - t[k]).cross(up).normalized();
      if (std::all_of(other.begin(), other.end(),
                      [&](const Vec3& p) { return out.dot(p - t[k]) >= -touch; })) {
        return true;
      }
    }
    return false;
  };
  return !separates(a, b) && !separates(b, a);
}

std::optional<Vec3> crossing(const Points3& points, const Triangle& ta, const Triangle& tb) {
  Corners a, b;
  for (std::size_t k = 0; k < 3; ++k) {
    a[k] = points.col(ta[k]);
    b[k] = points.col(tb[k]);
  }

  // Triangles that share a side touch there by right; those that share a corner cross where the
  // side across from it pierces the other.
  int shared = 0;
  std::size_t at_a = 0, at_b = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      if (ta[i] != tb[j]) continue;
      ++shared;
      at_a = i;
      at_b = j;
    }
  }
  if (shared >= 2) return std::nullopt;
  if (shared == 1) {
    if (auto x = pierce(a[(at_a + 1) % 3], a[(at_a + 2) % 3], b)) return x;
    return pierce(b[(at_b + 1) % 3], b[(at_b + 2) % 3], a);
  }

  for (std::size_t k = 0; k < 3; ++k) {
    if (auto x = pierce(a[k], a[(k + 1) % 3], b)) return x;
    if (auto x = pierce(b[k], b[(k + 1) % 3], a)) return x;
  }
  if (overlap_in_plane(a, b)) return Vec3((a[0] + a[1] + a[2] + b[0] + b[1] + b[2]) / 6);
  return std::nullopt;
}

struct Box {
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity());
  Vec3 high = Vec3::Constant(-std::numeric_limits<double>::infinity());

  void add(const Vec3& p) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  void add(const Box& b) {
    low = low.cwiseMin(b.low);
    high = high.cwiseMax(b.high);
  }
  bool meets(const Box& b) const {
    return (low.array() <= b.high.array()).all() && (b.low.array() <= high.array()).all();
  }
};

// Three times 21 bits, interleaved.
std::uint64_t morton(const Vec3& share) {
  const auto spread = [](double x) {
    auto v = static_cast<std::uint64_t>(std::clamp(x, 0.0, 1.0) * 2097151.0);
    v = (v | v << 32) & 0x1f00000000ffffULL;
    v = (v | v << 16) & 0x1f0000ff0000ffULL;
    v = (v | v << 8) & 0x100f00f00f00f00fULL;
    v = (v | v << 4) & 0x10c30c30c30c30c3ULL;
    return (v | v << 2) & 0x1249249249249249ULL;
  };
  return spread(share.x()) | spread(share.y()) << 1 | spread(share.z()) << 2;
}

// A binary tree over triangles in Morton order. The node of the leaves [first, last) is followed by
// its left half's nodes, then its right half's: 2 n - 1 nodes for n leaves.
class Tree {
 public:
  Tree(const Points3& points, const std::vector<Triangle>& triangles)
      : points_(points), triangles_(triangles), order_(triangles.size()) {
    Box all;
    for (Eigen::Index k = 0; k < points.cols(); ++k) all.add(Vec3(points.col(k)));
    const double size = std::max((all.high - all.low).maxCoeff(), 1e-300);

    // In the order of a space-filling curve (Morton 1966): neighbours in the list are neighbours in
    // space.
    std::vector<std::pair<std::uint64_t, std::uint32_t>> codes(triangles.size());
    tbb::parallel_for(std::size_t{0}, triangles.size(), [&](std::size_t t) {
      const Vec3 middle = (points.col(triangles[t][0]) + points.col(triangles[t][1]) +
                           points.col(triangles[t][2])) /
                          3;
      codes[t] = {morton((middle - all.low) / size), static_cast<std::uint32_t>(t)};
    });
    tbb::parallel_sort(codes.begin(), codes.end());
    for (std::size_t t = 0; t < codes.size(); ++t) order_[t] = codes[t].second;

    leaf_count_ = (triangles.size() + kLeaf - 1) / kLeaf;
    if (leaf_count_ > 0) {
      boxes_.resize(2 * leaf_count_ - 1);
      fill(0, 0, leaf_count_);
    }
  }

  std::size_t leaf_count() const { return leaf_count_; }

  // Calls `visit(a, b)` for triangles of this leaf and of it or later ones whose boxes meet.
  template <typename Visit>
  void collide(std::size_t leaf, const Visit& visit) const {
    Box box;
    std::array<Box, kLeaf> own;
    const std::size_t begin = leaf * kLeaf, end = std::min(begin + kLeaf, order_.size());
    for (std::size_t k = begin; k < end; ++k) {
      own[k - begin] = triangle_box(order_[k]);
      box.add(own[k - begin]);
    }
    descend(0, 0, leaf_count_, leaf, box, [&](std::size_t other) {
      const std::size_t other_end = std::min((other + 1) * kLeaf, order_.size());
      for (std::size_t k = begin; k < end; ++k) {
        for (std::size_t l = other == leaf ? k + 1 : other * kLeaf; l < other_end; ++l) {
          if (own[k - begin].meets(triangle_box(order_[l]))) visit(order_[k], order_[l]);
        }
      }
    });
  }

 private:
  Box triangle_box(std::uint32_t t) const {
    Box box;
    for (const int p : triangles_[t]) box.add(Vec3(points_.col(p)));
    return box;
  }

  const Box& fill(std::size_t node, std::size_t first, std::size_t last) {
    Box box;
    if (last - first == 1) {
      const std::size_t end = std::min(last * kLeaf, order_.size());
      for (std::size_t k = first * kLeaf; k < end; ++k) box.add(triangle_box(order_[k]));
    } else {
      const std::size_t mid = (first + last) / 2;
      box.add(fill(node + 1, first, mid));
      box.add(fill(node + 2 * (mid - first), mid, last));
    }
    return boxes_[node] = box;
  }

  template <typename Reach>
  void descend(std::size_t node, std::size_t first, std::size_t last, std::size_t from,
               const Box& box, const Reach& reach) const {
    if (last <= from || !boxes_[node].meets(box)) return;
    if (last - first == 1) {
      reach(first);
      return;
    }
    const std::size_t mid = (first + last) / 2;
    descend(node + 1, first, mid, from, box, reach);
    descend(node + 2 * (mid - first), mid, last, from, box, reach);
  }

  const Points3& points_;
  const std::vector<Triangle>& triangles_;
  std::vector<std::uint32_t> order_;
  std::vector<Box> boxes_;
  std::size_t leaf_count_ = 0;
};

}  // namespace

std::vector<TriangleCrossing> crossing_triangles(const Points3& points,
                                                 const std::vector<Triangle>& triangles,
                                                 const std::vector<int>& group_of,
                                                 const Progress& progress) {
  const Tree tree(points, triangles);

  // Fixed chunks, gathered in their order: the same result on any number of cores.
  constexpr std::size_t kChunk = 1024;
  const std::size_t chunks = (tree.leaf_count() + kChunk - 1) / kChunk;
  std::vector<std::map<std::array<int, 2>, Vec3>> found(chunks);
  tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t c) {
    if (progress.should_stop()) return;
    const std::size_t end = std::min((c + 1) * kChunk, tree.leaf_count());
    for (std::size_t leaf = c * kChunk; leaf < end; ++leaf) {
      tree.collide(leaf, [&](std::uint32_t a, std::uint32_t b) {
        std::array<int, 2> groups{group_of[a], group_of[b]};
        if (groups[0] > groups[1]) std::swap(groups[0], groups[1]);
        if (found[c].contains(groups)) return;
        if (const auto x = crossing(points, triangles[a], triangles[b])) {
          found[c].emplace(groups, *x);
        }
      });
    }
  });

  std::map<std::array<int, 2>, Vec3> all;
  for (const auto& part : found) all.insert(part.begin(), part.end());
  std::vector<TriangleCrossing> result;
  for (const auto& [groups, place] : all) result.push_back({groups, place});
  return result;
}

}  // namespace angiospline
