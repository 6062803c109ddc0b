#include "benches/kernel_samples.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <numbers>

#include <Eigen/Geometry>

#include "base/random.h"
#include "kernel/evaluate/grid.h"
#include "kernel/fit/fit.h"
#include "kernel/refine/periodic.h"

namespace angiospline::bench {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

}  // namespace

KnotVector uniform_knots(int degree, int count) {
  return KnotVector::clamped(degree, spaced(0, 1, count - degree + 1));
}

BSplineSurface<3> sheet() {
  const KnotVector knots = uniform_knots(5, 20);
  Random random(1);
  Eigen::Matrix3Xd net(3, 400);
  for (int i = 0; i < 20; ++i) {
    for (int j = 0; j < 20; ++j) net.col(i * 20 + j) << i, j, random.uniform();
  }
  return BSplineSurface<3>(knots, knots, net);
}

Eigen::Matrix2Xd grid_parameters() {
  Eigen::Matrix2Xd parameters(2, 40000);
  for (int i = 0; i < 200; ++i) {
    for (int j = 0; j < 200; ++j) parameters.col(i * 200 + j) << i / 199.0, j / 199.0;
  }
  return parameters;
}

Eigen::Matrix2Xd shuffled(Eigen::Matrix2Xd parameters) {
  Random random(2);
  for (int i = static_cast<int>(parameters.cols()) - 1; i > 0; --i) {
    parameters.col(i).swap(parameters.col(random.below(i + 1)));
  }
  return parameters;
}

BSplineCurve<3> helix(int count, double noise) {
  const KnotVector knots = uniform_knots(5, count);
  const std::vector<double> nodes = knots.greville();
  Eigen::Matrix3Xd points(3, count);
  for (int i = 0; i < count; ++i) {
    const double s = nodes[static_cast<std::size_t>(i)];
    points.col(i) << 10 * std::cos(5 * kTurn * s), 10 * std::sin(5 * kTurn * s), 25 * s;
  }
  Eigen::Matrix3Xd net = interpolate_at_greville<3>(knots, points).control_points();
  Random random(7);
  for (Eigen::Index i = 0; i < net.size(); ++i) net.data()[i] += noise * random.gaussian();
  return BSplineCurve<3>(knots, net);
}

BSplineSurface<3> tube(int along, int around) {
  const KnotVector u = uniform_knots(5, along);
  const KnotVector v = uniform_knots(5, around);
  const std::vector<double> us = u.greville();
  const std::vector<double> vs = v.greville();
  Eigen::Matrix3Xd points(3, static_cast<Eigen::Index>(along) * around);
  for (int i = 0; i < along; ++i) {
    const double s = kTurn * us[static_cast<std::size_t>(i)];
    const Eigen::Vector3d center(20 * s / std::numbers::pi, 5 * std::sin(s), 3 * std::cos(1.5 * s));
    const Eigen::Vector3d tangent =
        Eigen::Vector3d(20 / std::numbers::pi, 5 * std::cos(s), -4.5 * std::sin(1.5 * s))
            .normalized();
    const Eigen::Vector3d normal = Eigen::Vector3d::UnitZ().cross(tangent).normalized();
    const Eigen::Vector3d binormal = tangent.cross(normal);
    const double radius = 2 + 0.3 * std::sin(3 * s);
    for (int j = 0; j < around; ++j) {
      const double a = kTurn * vs[static_cast<std::size_t>(j)];
      points.col(static_cast<Eigen::Index>(i) * around + j) =
          center + radius * (std::cos(a) * normal + std::sin(a) * binormal);
    }
  }
  return interpolate_at_greville<3>(u, v, points);
}

BSplineSurface<3> ring(int along, int around) {
  const auto closed_knots = [](int count) {
    std::vector<Knot> period;
    for (int k = 0; k < count; ++k) period.push_back({1.0 * k / count, 1});
    return *periodic_knots(5, period, 1);
  };
  std::vector<double> us, vs;
  for (int i = 0; i < 4 * along; ++i) us.push_back(i / (4.0 * along));
  for (int j = 0; j < 4 * around; ++j) vs.push_back(j / (4.0 * around));
  Eigen::Matrix3Xd points(3, static_cast<Eigen::Index>(us.size() * vs.size()));
  Eigen::Index column = 0;
  for (const double u : us) {
    for (const double v : vs) {
      const double a = kTurn * u;
      const double b = kTurn * v;
      const double r = 10 + (2 + 0.2 * std::cos(3 * a)) * std::cos(b);
      points.col(column++) << r * std::cos(a), r * std::sin(a), 2 * std::sin(b);
    }
  }
  return *fit_periodic<3>(closed_knots(along), closed_knots(around), us, vs, points);
}

double largest_distance(const BSplineCurve<3>& a, const BSplineCurve<3>& b) {
  const auto t = spaced(0, 1, 40001);
  return (evaluate(a, t) - evaluate(b, t)).colwise().norm().maxCoeff();
}

double largest_distance(const BSplineSurface<3>& a, const BSplineSurface<3>& b) {
  const auto u = spaced(0, 1, 901);
  const auto v = spaced(0, 1, 301);
  return (evaluate_grid(a, u, v).points() - evaluate_grid(b, u, v).points())
      .colwise()
      .norm()
      .maxCoeff();
}

double ratio_in_turn(const std::function<void()>& ours, const std::function<void()>& theirs) {
  constexpr int kTurns = 21;
  const auto seconds = [](const std::function<void()>& work) {
    const auto now = [] {
      timespec t;
      clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
      return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
    };
    const double start = now();
    work();
    return now() - start;
  };
  std::vector<double> a, b;
  for (int turn = 0; turn < kTurns; ++turn) {
    a.push_back(seconds(ours));
    b.push_back(seconds(theirs));
  }
  const auto median = [](std::vector<double> values) {
    std::nth_element(values.begin(), values.begin() + kTurns / 2, values.end());
    return values[kTurns / 2];
  };
  return median(a) / median(b);
}

std::vector<double> u_fastest(const BSplineSurface<3>& surface) {
  std::vector<double> net;
  for (int j = 0; j < surface.v_count(); ++j) {
    for (int i = 0; i < surface.u_count(); ++i) {
      const Eigen::Vector3d p = surface.control_point(i, j);
      net.insert(net.end(), {p.x(), p.y(), p.z()});
    }
  }
  return net;
}

BSplineSurface<3> from_u_fastest(const KnotVector& u, const KnotVector& v, const double* net) {
  const int m = u.control_point_count();
  const int n = v.control_point_count();
  Eigen::Matrix3Xd points(3, static_cast<Eigen::Index>(m) * n);
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < m; ++i, net += 3) {
      points.col(static_cast<Eigen::Index>(i) * n + j) << net[0], net[1], net[2];
    }
  }
  return BSplineSurface<3>(u, v, points);
}

}  // namespace angiospline::bench
