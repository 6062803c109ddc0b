// Pairs of triangles of one mesh that cross each other.
#pragma once

#include <array>
#include <vector>

#include "base/progress.h"
#include "base/vector.h"

namespace angiospline {

struct TriangleCrossing {
  std::array<int, 2> groups;  // of the two triangles, the lower first
  Vec3 place = Vec3::Zero();  // a point where they meet
};

// One crossing for each pair of groups that has any, in order of the groups. Triangles that share
// one point cross when an edge of one goes through the other; those that share two do not count.
// Touching (within 1e-9 of a triangle's size) is not crossing; lying in one plane and overlapping
// is. Self-collision of a bounding-volume tree over Morton codes, on all cores, with the same
// result on any number of them. O(n log n + pairs). Stops early, with what it has, on request.
std::vector<TriangleCrossing> crossing_triangles(const Points3& points,
                                                 const std::vector<std::array<int, 3>>& triangles,
                                                 const std::vector<int>& group_of,
                                                 const Progress& progress = {});

}  // namespace angiospline
