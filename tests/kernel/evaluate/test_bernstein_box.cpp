// Boxes of squared distances against the distances themselves.
#include <algorithm>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "kernel/evaluate/bernstein_box.h"
#include "tests/shapes/random_splines.h"

namespace angiospline {
namespace {

using Vec3d = Eigen::Vector3d;

// The value at (u, v), in [0, 1] within the box, of a tensor Bernstein form, by de Casteljau.
double value(BernsteinBox::Coefficients C, double u, double v) {
  for (Eigen::Index r = C.rows() - 1; r > 0; --r)
    C.topRows(r) = ((1 - u) * C.topRows(r) + u * C.middleRows(1, r)).eval();
  for (Eigen::Index r = C.cols() - 1; r > 0; --r)
    C.leftCols(r) = ((1 - v) * C.leftCols(r) + v * C.middleCols(1, r)).eval();
  return C(0, 0);
}

double along(const BernsteinBox& box, std::size_t axis, double share) {
  return box.low[axis] + share * (box.high[axis] - box.low[axis]);
}

TEST(BernsteinBox, OfASurfaceSpanIsItsSquaredDistance) {
  Random random(1);
  for (int round = 0; round < 30; ++round) {
    const KnotVector u = random_knots(random, 1 + random.below(4)), v = random_knots(random, 2);
    const BSplineSurface<3> surface = random_surface<3>(random, u, v);
    const Vec3d target(random.gaussian(), random.gaussian(), random.gaussian());
    const BernsteinBox box =
        bernstein_box<3, 3>(surface, u.span(u.first()), v.span(v.last()), target);
    for (int k = 0; k < 20; ++k) {
      const double a = random.uniform(), b = random.uniform();
      const double squared =
          (surface.at(along(box, 0, a), along(box, 1, b)) - target).squaredNorm();
      EXPECT_NEAR(value(box.F, a, b), squared, 1e-11 * (1 + squared));
      EXPECT_LE(box.lower_bound(), squared + 1e-11);
    }
  }
}

TEST(BernsteinBox, OfARationalCurveIsTheSquaredDistanceTimesTheSquaredWeight) {
  Random random(2);
  const KnotVector knots = KnotVector::clamped(3, {0, 1, 3});
  BSplineCurve<3>::ControlPoints points(3, knots.control_point_count());
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const double w = random.uniform(0.5, 2);
    points.col(i) << w * random.gaussian(), w * random.gaussian(), w;
  }
  const BSplineCurve<3> homogeneous(knots, points);
  const Eigen::Vector2d target(0.3, -0.2);
  const BernsteinBox box = bernstein_box<2, 3>(homogeneous, knots.span(2), target);
  for (int k = 0; k <= 20; ++k) {
    const double t = along(box, 0, k / 20.0);
    const Vec3d at = homogeneous.at(t);
    const double squared = (at.head<2>() / at(2) - target).squaredNorm();
    EXPECT_NEAR(value(box.F, k / 20.0, 0) / value(box.W, k / 20.0, 0), squared, 1e-12);
    EXPECT_LE(box.lower_bound(), squared + 1e-12);
  }
}

TEST(BernsteinBox, HalvesCoverTheBoxAndRaiseTheBoundToTheLeastDistance) {
  Random random(3);
  const KnotVector knots = KnotVector::bezier(4, 0, 1);
  for (int round = 0; round < 20; ++round) {
    const BSplineCurve<2> curve = random_curve<2>(random, knots);
    const Eigen::Vector2d target(random.gaussian(), random.gaussian());
    double least = std::numeric_limits<double>::infinity();
    for (int k = 0; k <= 4096; ++k)
      least = std::min(least, (curve.at(k / 4096.0) - target).squaredNorm());
    std::vector<BernsteinBox> boxes{bernstein_box<2, 2>(curve, 4, target)};
    const double first_bound = boxes.front().lower_bound();
    for (int depth = 0; depth < 8; ++depth) {
      std::vector<BernsteinBox> next;
      for (const BernsteinBox& box : boxes) {
        const auto [low, high] = box.halves();
        EXPECT_EQ(low.low[0], box.low[0]);
        EXPECT_EQ(low.high[0], high.low[0]);
        EXPECT_EQ(high.high[0], box.high[0]);
        next.push_back(low);
        next.push_back(high);
      }
      boxes = std::move(next);
    }
    double bound = std::numeric_limits<double>::infinity();
    for (const BernsteinBox& box : boxes) bound = std::min(bound, box.lower_bound());
    EXPECT_GE(bound, first_bound);
    EXPECT_LE(bound, least + 1e-12);
    EXPECT_NEAR(bound, least, 1e-2);
  }
}

TEST(BernsteinBox, IsConvexAboutTheFootOnALineAndNotWhereACurveTurnsBack) {
  Eigen::Matrix2Xd line(2, 2);
  line << 0, 4, 0, 0;
  EXPECT_TRUE((bernstein_box<2, 2>(BSplineCurve<2>(KnotVector::bezier(1, 0, 1), line), 1,
                                   Eigen::Vector2d(1, 1))
                   .is_convex(1)));
  Eigen::Matrix2Xd turn(2, 3);  // a parabola seen from far inside: two feet
  turn << -1, 0, 1, 4, -4, 4;
  EXPECT_FALSE((bernstein_box<2, 2>(BSplineCurve<2>(KnotVector::bezier(2, 0, 1), turn), 2,
                                    Eigen::Vector2d(0, 5))
                    .is_convex(1)));
}

TEST(BernsteinBox, TheLowestCoefficientSaysWhereToBegin) {
  Eigen::Matrix2Xd line(2, 2);
  line << 0, 4, 0, 0;
  const BernsteinBox box = bernstein_box<2, 2>(BSplineCurve<2>(KnotVector::bezier(1, 2, 3), line),
                                               1, Eigen::Vector2d(5, 0));
  EXPECT_EQ(box.lowest()[0], 3);
  EXPECT_TRUE(box.holds(2.5, 0));
  EXPECT_FALSE(box.holds(3.5, 0));
}

}  // namespace
}  // namespace angiospline
