// A triangle mesh of a network on its way: points and triangles as they come.
#pragma once

#include <array>
#include <utility>
#include <vector>

#include "base/index.h"
#include "base/vector.h"
#include "modeling/network/tessellation.h"

namespace angiospline {

// A chain of mesh points along a growing coordinate.
struct MeshChain {
  std::vector<double> at;
  std::vector<int> points;

  void push(double t, int point) {
    at.push_back(t);
    points.push_back(point);
  }
  // From the other end, along the negative coordinate.
  MeshChain reversed() const {
    MeshChain r{{at.rbegin(), at.rend()}, {points.rbegin(), points.rend()}};
    for (double& t : r.at) t = -t;
    return r;
  }
};

// Calls add(a, b, c) for the triangles of the strip between an outer chain and an inner one on its
// left, counter-clockwise. Each triangle takes a step along the chain whose next segment has its
// middle first, so that cross edges stay short whatever the spacing. O(points).
template <typename AddTriangle>
void zip_chains(const MeshChain& outer, const MeshChain& inner, AddTriangle add) {
  std::size_t o = 0;
  std::size_t i = 0;
  while (o + 1 < outer.points.size() || i + 1 < inner.points.size()) {
    const bool can_outer = o + 1 < outer.points.size();
    const bool can_inner = i + 1 < inner.points.size();
    if (can_outer &&
        (!can_inner || outer.at[o] + outer.at[o + 1] <= inner.at[i] + inner.at[i + 1])) {
      add(outer.points[o], outer.points[o + 1], inner.points[i]);
      ++o;
    } else {
      add(outer.points[o], inner.points[i + 1], inner.points[i]);
      ++i;
    }
  }
}

struct TessellationDraft {
  std::vector<Vec3> points;
  std::vector<Vec3> normals;  // of any length: sums over the patches that meet at a point
  std::vector<PatchPoint> origins;
  std::vector<std::array<int, 3>> triangles;
  std::vector<int> part_of;

  // The number of a new point, its normal still 0.
  int add_point(const PatchPoint& origin, const Vec3& position) {
    points.push_back(position);
    normals.emplace_back(Vec3::Zero());
    origins.push_back(origin);
    return static_cast<int>(points.size()) - 1;
  }
  void add_triangle(int a, int b, int c, int part) {
    triangles.push_back({a, b, c});
    part_of.push_back(part);
  }
  // A cell of a grid, counter-clockwise, cut along its shorter diagonal.
  void add_cell(const std::array<int, 4>& c, int part);
  void add_strip(const MeshChain& outer, const MeshChain& inner, int part) {
    zip_chains(outer, inner, [&](int a, int b, int c) { add_triangle(a, b, c, part); });
  }
};

// Closes each rim by a plane cap of rings towards the middle, on the points of `loops` (one a rim,
// each once around with the cap on its left); parts are numbered on from `first_part`. Requires
// loops that are star-shaped about their mean.
void add_caps(const std::vector<Rim>& rims, const std::vector<std::vector<int>>& loops,
              int first_part, TessellationDraft& draft);

}  // namespace angiospline
