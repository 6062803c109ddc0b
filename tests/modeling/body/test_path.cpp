// The path of a body: the fit to its target, the way back to it, and the seams of its ends.
#include <cmath>
#include <numbers>
#include <numeric>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "base/index.h"
#include "modeling/body/lead_in.h"
#include "modeling/body/path.h"
#include "modeling/body/path_fit.h"
#include "modeling/body/rules.h"
#include "modeling/body/seams.h"

namespace angiospline {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kPi = std::numbers::pi;

// Along z, radius 1.
Eigen::Matrix4Xd straight_target(double length, int count = 200) {
  Eigen::Matrix4Xd target(4, count - 1);
  for (int i = 1; i < count; ++i) target.col(i - 1) << 0, 0, length * i / count, 1;
  return target;
}

// A quarter of a circle in the plane of x and z, from the origin along z, radius 1.
Eigen::Matrix4Xd arc_target(double bend_radius, int count = 200) {
  Eigen::Matrix4Xd target(4, count + 1);
  for (int i = 0; i <= count; ++i) {
    const double a = kPi / 2 * i / count;
    target.col(i) << bend_radius * (1 - std::cos(a)), 0, bend_radius * std::sin(a), 1;
  }
  return target;
}

TEST(Bend, OfACircleIsOneOverItsRadius) {
  const Eigen::Matrix4Xd target = arc_target(5);
  const BodyPath path = fit_body_path(target, {target.col(0).head<3>(), 1, Vec3::Zero()},
                                      {target.rightCols<1>().col(0).head<3>(), 1, Vec3::Zero()});
  const std::vector<Bend> bends = bends_of(path.curve, 40);
  ASSERT_EQ(bends.size(), 41U);
  for (std::size_t k = 5; k < 36; ++k) {
    EXPECT_NEAR(bends[k].curvature, 0.2, 0.01);
    EXPECT_NEAR(bends[k].tightness(), bends[k].curvature * bends[k].radius, 1e-15);
  }
  EXPECT_NEAR(bends[20].parameter, 0.5, 1e-15);
  EXPECT_GE(tightest(bends), bends[20].tightness());
}

// A direction that an end's target misses is made up for as by a beam on an elastic foundation:
// with delta + 4 r^4 d^4 delta / ds^4 = 0 it is 2 r angle exp(-x) sin x, x = s / 2 r (Hetenyi
// 1946).
TEST(PathFit, MakesUpForATurnedEndAsABeamOnAnElasticFoundation) {
  const double length = 60;
  const double angle = 0.02;
  const PathEnd start{{0, 0, 0}, 1, Vec3(std::sin(angle), 0, std::cos(angle))};
  const PathEnd end{{0, 0, length}, 1, Vec3::UnitZ()};
  const PathFit fit(make_rail(straight_target(length), start, end), start, end, kInfinity);
  for (const double s : {0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 8.0, 12.0}) {
    const double x = s / 2;
    const double expected = 2 * angle * std::exp(-x) * std::sin(x);
    EXPECT_NEAR(fit.course().at(s / length)(0), expected, 0.02 * angle) << s;
  }
  EXPECT_NEAR((fit.course().at(0, 1).head<3>().normalized() - start.direction).norm(), 0, 1e-9);
}

TEST(PathFit, StiffensNothingOnAStraightPathAndATightBendUntilItIsNone) {
  const PathEnd start{{0, 0, 0}, 1, Vec3::UnitZ()};
  const PathEnd end{{0, 0, 30}, 1, Vec3::UnitZ()};
  PathFit straight(make_rail(straight_target(30), start, end), start, end, kInfinity);
  EXPECT_FALSE(straight.stiffen(straight.course()));

  // An end that looks across its target bends the beam too tightly.
  const PathEnd turned{{0, 0, 0}, 1, Vec3(std::sin(1.1), 0, std::cos(1.1))};
  PathFit bent(make_rail(straight_target(30), turned, end), turned, end, kInfinity);
  BSplineCurve<4> curve = bent.course();
  const int samples = 4 * bent.span_count();
  ASSERT_GT(tightest(bends_of(curve, samples)), kTightestBend);
  int rounds = 0;
  while (bent.stiffen(curve) && ++rounds < PathLadderRules::kRounds) curve = bent.solve();
  EXPECT_LE(tightest(bends_of(curve, samples)), kTightestBend);
  EXPECT_NEAR((curve.at(0).head<3>()).norm(), 0, 1e-12);
  EXPECT_NEAR((curve.at(0, 1).head<3>().normalized() - turned.direction).norm(), 0, 1e-9);
}

TEST(FitBodyPath, BeginsAndEndsExactlyAtItsEndsWithTheRadiusLevelThere) {
  const Eigen::Matrix4Xd target = arc_target(6);
  const PathEnd start{{0.2, 0.1, -0.1}, 1.1, Vec3(0.1, 0, 1).normalized()};
  const PathEnd end{{6.1, -0.1, 6}, 0.9, Vec3(1, 0.1, 0).normalized()};
  for (const PathFreedom freedom :
       {PathFreedom::kNearTarget, PathFreedom::kNarrower, PathFreedom::kAnyMove}) {
    const BodyPath path = fit_body_path(target, start, end, freedom);
    for (const auto& [t, e] : {std::pair{0.0, start}, {1.0, end}}) {
      EXPECT_NEAR((path.curve.at(t).head<3>() - e.point_mm).norm(), 0, 1e-12);
      EXPECT_NEAR(path.curve.at(t)(3), e.radius_mm, 1e-12);
      EXPECT_NEAR((path.curve.at(t, 1).head<3>().normalized() - e.direction).norm(), 0, 1e-9);
      EXPECT_NEAR(path.curve.at(t, 1)(3), 0, 1e-9);
    }
  }
}

TEST(DepartureFrom, IsTheLargestDistanceInMillimetresAndRadii) {
  Eigen::Matrix4Xd points(4, 2);
  points << 0, 0, 0, 0, 0, 10, 1, 1;
  const BSplineCurve<4> line(KnotVector::bezier(1), points);
  Eigen::Matrix4Xd off(4, 3);
  off << 0.1, 0, 0.3, 0, -0.4, 0, 2, 5, 8, 0.5, 2, 0.5;
  const AxisDeparture worst = departure_from(line, off, {0.2, 0.5, 0.8});
  EXPECT_NEAR(worst.mm, 0.4, 1e-12);
  EXPECT_NEAR(worst.radii, 0.2, 1e-12);
}

BSplineCurve<4> course_of(const Eigen::Matrix4Xd& target) {
  const PathEnd start{target.col(0).head<3>(), 1, Vec3::Zero()};
  const PathEnd end{target.rightCols<1>().col(0).head<3>(), 1, Vec3::Zero()};
  return fit_body_path(target, start, end).curve;
}

TEST(LeadIn, LeavesAlongItsEndAndJoinsTheCourseWithItsTangent) {
  // The course turns away to x; the end looks along y.
  const BSplineCurve<4> course = course_of(arc_target(20));
  const PathEnd end{{0, 0, 0}, 1, Vec3(0, 0.8, 0.6)};
  const auto lead = find_lead_in(course, false, end, 0.65, 0.9);
  ASSERT_TRUE(lead);
  EXPECT_LE(lead->largest_bend, 0.65);
  EXPECT_GT(lead->joins_at, 0);
  EXPECT_LT(lead->joins_at, 0.9);
  const Eigen::Index last = lead->samples.cols() - 1;
  EXPECT_NEAR(lead->samples.col(0).head<3>().norm(), 0, 1e-12);
  const Vec3 first = (lead->samples.col(1) - lead->samples.col(0)).head<3>().normalized();
  EXPECT_GT(first.dot(end.direction), 0.99);
  const Vec4 joined = course.at(lead->joins_at);
  const Vec3 arriving = (joined - lead->samples.col(last)).head<3>().normalized();
  EXPECT_GT(arriving.dot(course.at(lead->joins_at, 1).head<3>().normalized()), 0.99);

  // None that joins earlier, by a step, bends as little.
  const double speed = course.at(0.0, 1).head<3>().norm();
  const double step = LeadInRules::kStepRadii / speed;
  if (lead->joins_at > 1.5 * step) {
    const auto earlier = find_lead_in(course, false, end, 0.65, lead->joins_at - 0.5 * step);
    ASSERT_TRUE(earlier);
    EXPECT_GT(earlier->largest_bend, 0.65);
  }
}

TEST(LeadIn, FromTheLastEndIsThatOfTheCourseTurnedRound) {
  const Eigen::Matrix4Xd target = arc_target(20);
  const BSplineCurve<4> course = course_of(target);
  const BSplineCurve<4> turned(course.knots(), course.control_points().rowwise().reverse().eval());
  const PathEnd first{{0, 0, 0}, 1, Vec3(0, 0.8, 0.6)};
  const PathEnd last{{0, 0, 0}, 1, Vec3(0, -0.8, -0.6)};
  const auto a = find_lead_in(course, false, first, 0.65, 0.9);
  const auto b = find_lead_in(turned, true, last, 0.65, 0.9);
  ASSERT_TRUE(a && b);
  EXPECT_NEAR(a->joins_at, b->joins_at, 1e-12);
  EXPECT_NEAR((a->samples - b->samples).cwiseAbs().maxCoeff(), 0, 1e-9);
}

TEST(LeadIn, NeedsADirection) {
  const PathEnd free{{0, 0, 0}, 1, Vec3::Zero()};
  EXPECT_FALSE(find_lead_in(course_of(arc_target(20)), false, free, 0.65, 0.9));
}

// A circle of n arcs of equal length about z, the first beginning at this angle; each the quintic
// with exact tangents that meets its arc to third order.
BodyEnd circle_end(int n, double z, double first_angle) {
  BodyEnd end{{0, 0, z}, Vec3::UnitZ(), 1.0, {}, true};
  const double w = 2 * kPi / n;
  for (int k = 0; k < n; ++k) {
    const auto at = [&](double a) { return Vec3(std::cos(a), -std::sin(a), z); };
    const auto along = [&](double a) { return Vec3(-std::sin(a), -std::cos(a), 0); };
    const auto inward = [&](double a) { return Vec3(-std::cos(a), std::sin(a), 0); };
    const double a = first_angle + k * w;
    const double b = a + w;
    Arc arc;
    arc.col(0) = at(a);
    arc.col(1) = at(a) + w / 5 * along(a);
    arc.col(2) = w * w / 20 * inward(a) + 2 * w / 5 * along(a) + at(a);
    arc.col(3) = w * w / 20 * inward(b) - 2 * w / 5 * along(b) + at(b);
    arc.col(4) = at(b) - w / 5 * along(b);
    arc.col(5) = at(b);
    end.arcs.push_back(arc);
  }
  return end;
}

Station station_of(const BodyEnd& end) {
  return {end.center_mm, Vec3::UnitX(), Vec3::UnitY(), end.radius_mm};
}

TEST(MatchSeams, GivesTheStripsOfBothCircles) {
  for (const auto& [a, b] : {std::pair{2, 2}, {2, 3}, {3, 4}, {4, 6}, {2, 6}}) {
    const BodyEnd start = circle_end(a, 0, 0.3);
    const BodyEnd end = circle_end(b, 5, 0.3);
    const SeamMatching match = match_seams(start, end, station_of(start), station_of(end));
    EXPECT_EQ(static_cast<int>(match.strips.size()), a + b - std::gcd(a, b));
    // The parts of arcs of different lengths are not cut at quite the same angles.
    EXPECT_NEAR(match.twist_rad, 0, a == b ? 1e-9 : 0.02);

    // Each circle is covered once by its parts.
    double first = 0, last = 0;
    for (const BodyStrip& strip : match.strips) {
      first += (strip.start.to - strip.start.from) / a;
      last += (strip.end.to - strip.end.from) / b;
    }
    EXPECT_NEAR(first, 1, 1e-12);
    EXPECT_NEAR(last, 1, 1e-12);
  }
}

TEST(MatchSeams, TurnsNoFartherThanHalfAnArcBetweenSeams) {
  for (const double turned : {0.1, 0.9, 2.0, 3.0, 5.5}) {
    const BodyEnd start = circle_end(3, 0, 0.0);
    const BodyEnd end = circle_end(3, 5, turned);
    const double twist = match_seams(start, end, station_of(start), station_of(end)).twist_rad;
    const double arc = 2 * kPi / 3;
    const double nearest = std::abs(turned - arc * std::round(turned / arc));
    EXPECT_NEAR(twist, nearest, 1e-9) << turned;
  }
}

TEST(BlendRings, IsEachEndsRingAtThatEndAndACircleBetween) {
  const BodyEnd start = circle_end(2, 0, 0.0);
  const BodyEnd end = circle_end(3, 5, 0.2);
  const SeamMatching match = match_seams(start, end, station_of(start), station_of(end));
  const Points3 first = ring_on_arcs(match.strips, start, true);
  const Points3 last = ring_on_arcs(match.strips, end, false);
  const std::vector<Vec2> at_start = blend_rings(match.start, match.end, 0.0);
  const std::vector<Vec2> at_end = blend_rings(match.start, match.end, 1.0);
  ASSERT_EQ(at_start.size(), 5 * match.strips.size());
  for (std::size_t c = 0; c < at_start.size(); ++c) {
    const auto column = static_cast<Eigen::Index>(c);
    EXPECT_NEAR((station_of(start).world(at_start[c]) - first.col(column)).norm(), 0, 1e-9);
    EXPECT_NEAR((station_of(end).world(at_end[c]) - last.col(column)).norm(), 0, 1e-9);
  }
  const std::vector<Vec2> between = blend_rings(match.start, match.end, 0.5);
  for (std::size_t k = 0; k < match.strips.size(); ++k) {
    EXPECT_NEAR(between[5 * k].norm(), 1, 0.02);  // as near as one quintic is to half a circle
  }
}

}  // namespace
}  // namespace angiospline
