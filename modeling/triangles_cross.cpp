#include "modeling/triangles_cross.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include <Eigen/Geometry>

namespace angiospline {
namespace {

using Triangle = std::array<Vec3, 3>;

// Whether the segment a b passes through the triangle, ends included (Moeller & Trumbore).
bool passes_through(const Vec3& a, const Vec3& b, const Triangle& t) {
  const Vec3 e1 = t[1] - t[0];
  const Vec3 e2 = t[2] - t[0];
  const Vec3 d = b - a;
  const Vec3 h = d.cross(e2);
  const double det = e1.dot(h);
  if (std::abs(det) < 1e-14 * e1.norm() * e2.norm() * d.norm()) return false;
  const Vec3 s = a - t[0];
  const double u = s.dot(h) / det;
  if (u < 0 || u > 1) return false;
  const Vec3 q = s.cross(e1);
  const double v = d.dot(q) / det;
  if (v < 0 || u + v > 1) return false;
  const double w = e2.dot(q) / det;
  return w >= 0 && w <= 1;
}

bool cross(const Triangle& a, const Triangle& b) {
  for (std::size_t k = 0; k < 3; ++k) {
    if (passes_through(a[k], a[(k + 1) % 3], b) || passes_through(b[k], b[(k + 1) % 3], a))
      return true;
  }
  return false;
}

bool touch(const Triangle& a, const Triangle& b, double tolerance_squared) {
  for (const Vec3& p : a) {
    for (const Vec3& q : b) {
      if ((p - q).squaredNorm() <= tolerance_squared) return true;
    }
  }
  return false;
}

}  // namespace

bool grids_cross(const std::vector<Points3>& grids, int size) {
  std::vector<Triangle> triangles;
  for (const Points3& g : grids) {
    for (int i = 0; i + 1 < size; ++i) {
      for (int j = 0; j + 1 < size; ++j) {
        const Vec3 a = g.col(i * size + j), b = g.col((i + 1) * size + j);
        const Vec3 c = g.col((i + 1) * size + j + 1), d = g.col(i * size + j + 1);
        triangles.push_back({a, b, c});
        triangles.push_back({a, c, d});
      }
    }
  }
  if (triangles.empty()) return false;
  struct Box {
    Vec3 low, high;
    std::size_t triangle;
  };
  std::vector<Box> boxes;
  Vec3 low = triangles[0][0], high = low;
  for (std::size_t k = 0; k < triangles.size(); ++k) {
    const Triangle& t = triangles[k];
    boxes.push_back({t[0].cwiseMin(t[1]).cwiseMin(t[2]), t[0].cwiseMax(t[1]).cwiseMax(t[2]), k});
    low = low.cwiseMin(boxes.back().low);
    high = high.cwiseMax(boxes.back().high);
  }
  Eigen::Index axis = 0;
  const double extent = (high - low).maxCoeff(&axis);
  const double tolerance_squared = 1e-12 * extent * extent;
  std::sort(boxes.begin(), boxes.end(), [&](const Box& a, const Box& b) {
    return a.low(axis) != b.low(axis) ? a.low(axis) < b.low(axis) : a.triangle < b.triangle;
  });
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    for (std::size_t j = i + 1; j < boxes.size() && boxes[j].low(axis) <= boxes[i].high(axis);
         ++j) {
      if ((boxes[j].low.array() > boxes[i].high.array()).any() ||
          (boxes[j].high.array() < boxes[i].low.array()).any()) {
        continue;
      }
      const Triangle& a = triangles[boxes[i].triangle];
      const Triangle& b = triangles[boxes[j].triangle];
      if (!touch(a, b, tolerance_squared) && cross(a, b)) return true;
    }
  }
  return false;
}

}  // namespace angiospline
