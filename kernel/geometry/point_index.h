// Which of many points is nearest to a place.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "base/vector.h"

namespace angiospline {

struct NearestPoint {
  Eigen::Index point = -1;  // its column
  double distance = 0.0;
};

// A kd-tree of points, 3 x n with n > 0. The same place has the same answer on any number of
// threads.
class PointIndex {
 public:
  explicit PointIndex(Points3 points);
  explicit PointIndex(const std::vector<Vec3>& points);
  ~PointIndex();

  NearestPoint nearest(const Vec3& place) const;
  std::array<NearestPoint, 2> nearest_two(const Vec3& place) const;  // of two points or more

 private:
  struct Tree;
  std::unique_ptr<const Tree> tree_;
};

}  // namespace angiospline
