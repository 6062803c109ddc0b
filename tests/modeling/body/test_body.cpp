#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "base/random.h"
#include "modeling/body/body.h"
#include "modeling/build/assembly.h"
#include "tests/shapes/network_measures.h"

namespace angiospline {
namespace {

using testing::enclosed_volume_mm3;
using testing::least_jacobian_ratio;
using testing::measure_seams;
constexpr double kPi = std::numbers::pi;

Eigen::Matrix4Xd sampled(const std::function<Vec4(double)>& path, int count = 200) {
  Eigen::Matrix4Xd points(4, count + 1);
  for (int i = 0; i <= count; ++i) points.col(i) = path(static_cast<double>(i) / count);
  return points;
}

PathEnd end_of(const Eigen::Matrix4Xd& target, Eigen::Index column) {
  return {target.col(column).head<3>(), target(3, column), Vec3::Zero()};
}

SurfaceNetwork tube(const Eigen::Matrix4Xd& target, double tolerance = 0.01) {
  const BodyPath path = fit_body_path(target, end_of(target, 0), end_of(target, target.cols() - 1));
  BodyPiece piece;
  piece.start = free_end(path.curve, 0.0);
  piece.end = free_end(path.curve, 1.0);
  piece.body = make_body(path, piece.start, piece.end, {tolerance});
  piece.name = "wall_tube";
  piece.start_link.rim_name = "inlet";
  piece.end_link.rim_name = "outlet";
  return assemble({}, {piece});
}

// n arcs of a circle whose seams are shared out unevenly, C1 where they meet: cubic-exact tangents
// scaled to one length a seam.
std::vector<Arc> uneven_circle(const BodyEnd& end, const std::vector<double>& angles) {
  const Vec3 e1 = end.tangent.unitOrthogonal();
  const Vec3 e2 = -end.tangent.cross(e1);
  const std::size_t n = angles.size();
  std::vector<double> speed(n);
  const auto width = [&](std::size_t k) {
    return angles[(k + 1) % n] + (k + 1 == n ? 2 * kPi : 0.0) - angles[k];
  };
  for (std::size_t k = 0; k < n; ++k) speed[k] = (width(k) + width((k + n - 1) % n)) / 2;
  std::vector<Arc> arcs(n);
  for (std::size_t k = 0; k < n; ++k) {
    const double a = angles[k];
    const double w = width(k);
    const double s0 = speed[k];
    const double s1 = speed[(k + 1) % n];
    const double c0 = 6 * w - 4 * s0 - 2 * s1;
    const double c1 = -(6 * w - 4 * s1 - 2 * s0);
    const auto at = [&](double t) { return Vec2(std::cos(t), std::sin(t)); };
    const auto along = [&](double t) { return Vec2(-std::sin(t), std::cos(t)); };
    const std::array<Vec2, 2> p{at(a), at(a + w)};
    const std::array<Vec2, 2> v{s0 * along(a), s1 * along(a + w)};
    const std::array<Vec2, 2> acc{Vec2(-s0 * s0 * p[0] + c0 * along(a)),
                                  Vec2(-s1 * s1 * p[1] + c1 * along(a + w))};
    std::array<Vec2, 6> q{p[0],
                          p[0] + v[0] / 5,
                          acc[0] / 20 + 2 * v[0] / 5 + p[0],
                          acc[1] / 20 - 2 * v[1] / 5 + p[1],
                          p[1] - v[1] / 5,
                          p[1]};
    for (int j = 0; j < 6; ++j) {
      const Vec2& x = q[static_cast<std::size_t>(j)];
      arcs[k].col(j) = end.center_mm + end.radius_mm * (x.x() * e1 + x.y() * e2);
    }
  }
  return arcs;
}

TEST(ArcPart, LiesOnTheWholeArcAtItsParameters) {
  const Arc arc = two_arc_circle(Vec3(1, 2, 3), 2, Vec3::UnitZ(), Vec3::UnitX())[0];
  const Arc part = arc * arc_part_weights(0.25, 0.7).transpose();
  const BSplineCurve<3> whole(KnotVector::bezier(5), arc);
  const BSplineCurve<3> piece(KnotVector::bezier(5), part);
  for (const double t : {0.0, 0.3, 0.5, 1.0}) {
    EXPECT_LT((whole.at(0.25 + 0.45 * t) - piece.at(t)).norm(), 1e-14);
  }
}

TEST(Body, OfAStraightTubeIsACylinderOfTwoBezierPatches) {
  const double length = 10, radius = 1.5;
  const SurfaceNetwork network =
      tube(sampled([&](double t) { return Vec4(0, length * t, 3, radius); }));
  ASSERT_FALSE(find_defect(network)) << find_defect(network)->message();
  EXPECT_EQ(network.patches.size(), 2u);
  EXPECT_EQ(network.patches[0].u.control_point_count(), 6);
  EXPECT_NEAR(enclosed_volume_mm3(network), kPi * radius * radius * length, 1e-4);
  for (int p = 0; p < 2; ++p) {
    const BSplineSurface<3> s = patch_surface(network, p);
    for (double u = 0; u <= 1; u += 0.125) {
      for (double v = 0; v <= 1; v += 0.0625) {
        const Vec3 x = s.at(u, v);
        EXPECT_NEAR(std::hypot(x.x(), x.z() - 3), radius, 3e-6 * radius);
        EXPECT_GT(normal_vector(s, u, v).dot(Vec3(x.x(), 0, x.z() - 3)), 0);
      }
    }
  }
}

TEST(Body, FollowsAHelixWithATaper) {
  const auto path = [](double t) {
    const double a = 6 * t;
    return Vec4(10 * std::cos(a), 10 * std::sin(a), 5 * a, 2 - t);
  };
  const SurfaceNetwork network = tube(sampled(path, 400), 0.005);
  ASSERT_FALSE(find_defect(network));
  const testing::SeamMeasure seams = measure_seams(network);
  EXPECT_GT(seams.samples, 0);
  EXPECT_EQ(seams.gap_mm, 0);
  EXPECT_LT(seams.angle_deg, 1e-6);
  EXPECT_GT(least_jacobian_ratio(network), 0.4);
  // Pappus: the integral of pi r^2 along the arc.
  const double speed = std::hypot(10.0, 5.0) * 6;
  EXPECT_NEAR(enclosed_volume_mm3(network) / (speed * kPi * 7.0 / 3.0), 1.0, 0.005);
}

TEST(Body, IsTheSameShapeAtEveryScale) {
  const auto path = [](double t) {
    return Vec4(20 * t, 3 * std::sin(3 * t), std::cos(4 * t), 1 + 0.3 * t);
  };
  const SurfaceNetwork one = tube(sampled(path));
  const SurfaceNetwork tiny = tube(1e-6 * sampled(path));
  ASSERT_EQ(one.control_points_mm.cols(), tiny.control_points_mm.cols());
  EXPECT_LT((one.control_points_mm - 1e6 * tiny.control_points_mm).cwiseAbs().maxCoeff(), 1e-8);
}

TEST(Body, DoesNotFoldInAKink) {
  const auto path = [](double t) {
    const double x = 20 * t - 10;
    return Vec4(x, 2.5 * std::abs(x), 0, 2);
  };
  const SurfaceNetwork network = tube(sampled(path));
  ASSERT_FALSE(find_defect(network));
  EXPECT_GT(least_jacobian_ratio(network), 0.1);
  EXPECT_GT(enclosed_volume_mm3(network), 0);
}

// A leg, a part of a circle of radius `bend` and a leg, of radius 1.
Eigen::Matrix4Xd hairpin(double bend, double turn, double leg) {
  const double whole = 2 * leg + turn * bend;
  return sampled(
      [=](double t) {
        const double s = t * whole;
        const double angle = std::clamp((s - leg) / bend, 0.0, turn);
        const double rest = std::max(0.0, s - leg - turn * bend);
        return Vec4(bend * (1 - std::cos(angle)) + rest * std::sin(turn), 0,
                    std::min(s, leg) + bend * std::sin(angle) + rest * std::cos(turn), 1);
      },
      400);
}

// Bends tighter than the vessel is thick: the radius gives way in the bend alone, and the vessel
// goes all its way.
TEST(BodyPath, AHairpinIsNarrowedInItsBendAndNotCutOff) {
  int narrowed = 0;
  for (const double bend : {0.5, 0.7, 0.9, 1.1}) {
    for (const double turn : {0.5 * kPi, 0.75 * kPi, kPi}) {
      const double leg = 10;
      const Eigen::Matrix4Xd target = hairpin(bend, turn, leg);
      const Eigen::Index last = target.cols() - 1;
      const BodyPath path = fit_body_path(target, end_of(target, 0), end_of(target, last));
      std::vector<double> parameters;
      for (Eigen::Index i = 0; i <= last; ++i) {
        parameters.push_back(static_cast<double>(i) / static_cast<double>(last));
      }
      const std::string which = ::testing::PrintToString(std::pair(bend, turn));
      EXPECT_LT(departure_from(path.curve, target, parameters).radii, 2.0) << which;
      narrowed += path.narrowed > 0.1 ? 1 : 0;
      bool grows = false;
      double before = 1;
      for (int k = 0; k <= 1000; ++k) {
        const double t = k / 1000.0;
        const double radius = path.curve.at(t)(3);
        const Vec3 d1 = path.curve.at(t, 1).head<3>();
        const Vec3 d2 = path.curve.at(t, 2).head<3>();
        EXPECT_LT(d1.cross(d2).norm() / std::pow(d1.norm(), 3) * radius, 0.85) << which << t;
        EXPECT_GT(radius, 0.35 * kTightestBend * bend) << which << t;
        if (std::abs(t - 0.5) * (2 * leg + turn * bend) > 0.5 * turn * bend + 4) {
          EXPECT_GT(radius, 0.98) << which << t;
        }
        // One throat: it narrows, then widens.
        grows = grows || radius > before + 0.01;
        EXPECT_TRUE(!grows || radius > before - 0.01) << which << t;
        before = radius;
      }
    }
  }
  EXPECT_GE(narrowed, 5);
}

TEST(Body, JoinedEndsLeaveExactlyAlongTheirTangents) {
  const auto path = [](double t) { return Vec4(12 * t, 2 * std::sin(2 * t), t * t, 1.0); };
  const Eigen::Matrix4Xd target = sampled(path);
  const Vec3 d0 = Vec3(1, 0.1, 0.2).normalized();
  const Vec3 d1 = Vec3(1, -0.3, 0.1).normalized();
  PathEnd a = end_of(target, 0);
  PathEnd b = end_of(target, target.cols() - 1);
  a.direction = d0;
  b.direction = d1;
  const BodyPath fitted = fit_body_path(target, a, b);
  BodyEnd start{a.point_mm, d0, 1.0, {}, true};
  BodyEnd end{b.point_mm, d1, 1.0, {}, true};
  start.arcs = two_arc_circle(start.center_mm, 1.0, d0, d0.unitOrthogonal());
  end.arcs = uneven_circle(end, {0.3, 2.2, 4.4});
  const Body body = make_body(fitted, start, end);
  EXPECT_EQ(body.strips.size(), 4u);
  EXPECT_GT(body.jacobian_ratio, 0.1);
  const int last = (body.rows() - 1) * body.ring();
  for (int c = 0; c < body.ring(); ++c) {
    const Vec3 out = body.net.col(body.ring() + c) - body.net.col(c);
    const Vec3 in = body.net.col(last + c) - body.net.col(last - body.ring() + c);
    EXPECT_LT(out.cross(d0).norm(), 1e-13);
    EXPECT_LT(in.cross(d1).norm(), 1e-13);
    EXPECT_GT(out.dot(d0), 0);
    EXPECT_GT(in.dot(d1), 0);
  }
}

TEST(Body, BetweenDifferentNumbersOfUnevenArcsIsTangentPlaneContinuous) {
  Random random(7);
  int tried = 0;
  for (int trial = 0; trial < 30; ++trial) {
    const double bend = random.uniform(0, 1.2);
    const auto path = [&](double t) {
      return Vec4(8 * t, 2 * std::sin(bend * 3 * t), t, 1 + 0.4 * t);
    };
    const Eigen::Matrix4Xd target = sampled(path);
    const BodyPath fitted =
        fit_body_path(target, end_of(target, 0), end_of(target, target.cols() - 1));
    BodyPiece piece;
    piece.start = free_end(fitted.curve, 0.0);
    piece.end = free_end(fitted.curve, 1.0);
    const auto seams = [&](int n) {
      std::vector<double> angles;
      const double phase = random.uniform(-kPi, kPi);
      for (int k = 0; k < n; ++k) {
        angles.push_back(phase + 2 * kPi * (k + random.uniform(-0.2, 0.2)) / n);
      }
      return angles;
    };
    const int a = 2 + random.below(4);
    const int b = 2 + random.below(4);
    piece.start.arcs = uneven_circle(piece.start, seams(a));
    piece.end.arcs = uneven_circle(piece.end, seams(b));
    piece.body = make_body(fitted, piece.start, piece.end);
    piece.name = "wall_x";
    piece.start_link.rim_name = "a";
    piece.end_link.rim_name = "b";
    EXPECT_EQ(piece.body.ring(), 5 * (a + b - std::gcd(a, b)));
    const SurfaceNetwork network = assemble({}, {piece});
    ASSERT_FALSE(find_defect(network)) << find_defect(network)->message();
    EXPECT_LT(measure_seams(network).angle_deg, 1e-6) << trial;
    EXPECT_GT(piece.body.jacobian_ratio, 0.1) << trial;
    ++tried;
  }
  EXPECT_EQ(tried, 30);
}

TEST(Body, TwoOnSharedCirclesCloseARing) {
  const double R = 6, r = 1.5;
  std::vector<BodyPiece> pieces(2);
  for (int half = 0; half < 2; ++half) {
    const auto path = [&](double t) {
      const double a = kPi * (t + half);
      return Vec4(R * std::cos(a), R * std::sin(a), 0, r);
    };
    const Eigen::Matrix4Xd target = sampled(path);
    const double side = half == 0 ? 1 : -1;
    PathEnd from{Vec3(side * R, 0, 0), r, Vec3(0, side, 0)};
    PathEnd to{Vec3(-side * R, 0, 0), r, Vec3(0, -side, 0)};
    BodyPiece& piece = pieces[static_cast<std::size_t>(half)];
    const auto circle = [&](const PathEnd& e) {
      return BodyEnd{e.point_mm, e.direction, r,
                     two_arc_circle(e.point_mm, r, e.direction, Vec3::UnitZ()), true};
    };
    piece.start = circle(from);
    piece.end = circle(to);
    piece.body = make_body(fit_body_path(target, from, to), piece.start, piece.end, {0.001});
    piece.name = "wall_ring";
    piece.start_link.kind = piece.end_link.kind = BodyLink::Kind::kCircle;
    piece.start_link.circle = half;
    piece.end_link.circle = 1 - half;
  }
  const SurfaceNetwork network = assemble({}, pieces);
  ASSERT_FALSE(find_defect(network)) << find_defect(network)->message();
  EXPECT_TRUE(network.rims.empty());
  EXPECT_EQ(network.regions.size(), 1u);
  const testing::SeamMeasure seams = measure_seams(network);
  EXPECT_EQ(seams.gap_mm, 0);
  EXPECT_LT(seams.angle_deg, 1e-6);
  EXPECT_NEAR(enclosed_volume_mm3(network) / (2 * kPi * kPi * R * r * r), 1.0, 0.003);
}

}  // namespace
}  // namespace angiospline
