#include "kernel/geometry/point_index.h"

#include <cmath>
#include <utility>

#include <nanoflann.hpp>

#include "base/contract.h"

namespace angiospline {
namespace {

// What nanoflann wants of a point set.
struct Columns {
  Points3 points;

  std::size_t kdtree_get_point_count() const { return static_cast<std::size_t>(points.cols()); }
  double kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return points(static_cast<Eigen::Index>(axis), static_cast<Eigen::Index>(i));
  }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

}  // namespace

struct PointIndex::Tree {
  Columns columns;
  nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Columns>, Columns, 3,
                                      std::size_t>
      index;

  explicit Tree(Points3 points)
      : columns{std::move(points)},
        index(3, columns, nanoflann::KDTreeSingleIndexAdaptorParams(16)) {}
};

PointIndex::PointIndex(Points3 points) {
  EXPECTS(points.cols() > 0);
  tree_ = std::make_unique<const Tree>(std::move(points));
}

PointIndex::PointIndex(const std::vector<Vec3>& points)
    : PointIndex(Points3(Eigen::Map<const Points3>(points.empty() ? nullptr : points.front().data(),
                                                   3, std::ssize(points)))) {}

PointIndex::~PointIndex() = default;

NearestPoint PointIndex::nearest(const Vec3& place) const {
  std::size_t point = 0;
  double squared = 0;
  tree_->index.knnSearch(place.data(), 1, &point, &squared);
  return {static_cast<Eigen::Index>(point), std::sqrt(squared)};
}

std::array<NearestPoint, 2> PointIndex::nearest_two(const Vec3& place) const {
  EXPECTS(tree_->columns.points.cols() > 1);
  std::array<std::size_t, 2> points{};
  std::array<double, 2> squared{};
  tree_->index.knnSearch(place.data(), 2, points.data(), squared.data());
  return {NearestPoint{static_cast<Eigen::Index>(points[0]), std::sqrt(squared[0])},
          NearestPoint{static_cast<Eigen::Index>(points[1]), std::sqrt(squared[1])}};
}

}  // namespace angiospline
