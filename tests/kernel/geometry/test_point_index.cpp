#include <gtest/gtest.h>

#include "base/random.h"
#include "kernel/geometry/point_index.h"

namespace angiospline {
namespace {

TEST(PointIndex, FindsWhatLookingAtAllFinds) {
  Random random(7);
  Points3 points(3, 300);
  for (double& v : points.reshaped()) v = random.uniform();
  const PointIndex index(points);
  for (int k = 0; k < 200; ++k) {
    const Vec3 place = 1.5 * Vec3(random.uniform(), random.uniform(), random.uniform());
    Eigen::Index expected = -1;
    const double distance = (points.colwise() - place).colwise().norm().minCoeff(&expected);
    const NearestPoint found = index.nearest(place);
    EXPECT_EQ(found.point, expected);
    EXPECT_NEAR(found.distance, distance, 1e-14);
    const auto [first, second] = index.nearest_two(place);
    EXPECT_EQ(first.point, expected);
    Eigen::RowVectorXd others = (points.colwise() - place).colwise().norm();
    others(expected) = 10;
    EXPECT_NEAR(second.distance, others.minCoeff(), 1e-14);
  }
}

TEST(PointIndex, HasOnePointToFind) {
  const PointIndex index(Vec3(1, 2, 3));
  EXPECT_EQ(index.nearest(Vec3(1, 2, 5)).point, 0);
  EXPECT_EQ(index.nearest(Vec3(1, 2, 5)).distance, 2);
}

}  // namespace
}  // namespace angiospline
