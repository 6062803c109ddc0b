// Brute-force measures of a surface network, for tests: dense samples, nothing clever.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "modeling/network/surface_network.h"

namespace angiospline::testing {

struct SeamMeasure {
  double gap_mm = 0.0;
  double angle_deg = 0.0;
  int worst_join = -1;
  int samples = 0;
};

// Largest gap and largest angle between normals over every join, end points included.
inline SeamMeasure measure_seams(const SurfaceNetwork& network, int samples = 17) {
  SeamMeasure m;
  for (std::size_t j = 0; j < network.joins.size(); ++j) {
    const Join& join = network.joins[j];
    const BSplineSurface<3> a = patch_surface(network, join.a.patch);
    const BSplineSurface<3> b = patch_surface(network, join.b.patch);
    const Patch& pa = network.patches[static_cast<std::size_t>(join.a.patch)];
    const Patch& pb = network.patches[static_cast<std::size_t>(join.b.patch)];
    for (int i = 0; i < samples; ++i) {
      const double s = static_cast<double>(i) / (samples - 1);
      const Vec2 ua = side_parameters(pa, join.a.side, join_parameter_a(join, s));
      const Vec2 ub = side_parameters(pb, join.b.side, join_parameter_b(join, s));
      m.gap_mm = std::max(m.gap_mm, (a.at(ua.x(), ua.y()) - b.at(ub.x(), ub.y())).norm());
      const Vec3 na = normal_vector(a, ua.x(), ua.y()).normalized();
      const Vec3 nb = normal_vector(b, ub.x(), ub.y()).normalized();
      const double angle = std::atan2(na.cross(nb).norm(), na.dot(nb)) * 180 / std::numbers::pi;
      if (angle > m.angle_deg) {
        m.angle_deg = angle;
        m.worst_join = static_cast<int>(j);
      }
      ++m.samples;
    }
  }
  return m;
}

// Eight Gauss points: exact to degree 15.
inline constexpr std::array<double, 8> kGaussPoints{
    -0.9602898564975362, -0.7966664774136267, -0.525532409916329, -0.1834346424956498,
    0.1834346424956498,  0.525532409916329,   0.7966664774136267, 0.9602898564975362};
inline constexpr std::array<double, 8> kGaussWeights{
    0.1012285362903767, 0.2223810344533743, 0.313706645877887,  0.3626837833783618,
    0.3626837833783618, 0.313706645877887,  0.2223810344533743, 0.1012285362903767};

// The integral of f over [from, to], by Gauss points on each of the knots' spans inside.
template <typename Function>
double integral(const KnotVector& knots, double from, double to, const Function& f) {
  const std::vector<double> breaks = knots.breakpoints();
  double sum = 0;
  for (std::size_t k = 0; k + 1 < breaks.size(); ++k) {
    const double low = std::max(from, breaks[k]);
    const double half = (std::min(to, breaks[k + 1]) - low) / 2;
    if (half <= 0) continue;
    for (std::size_t g = 0; g < kGaussPoints.size(); ++g) {
      sum += half * kGaussWeights[g] * f(low + half * (1 + kGaussPoints[g]));
    }
  }
  return sum;
}

// Volume enclosed by the network and plane caps: one third of the flux of the position vector.
inline double enclosed_volume_mm3(const SurfaceNetwork& network) {
  double flux = 0;
  for (int p = 0; p < static_cast<int>(network.patches.size()); ++p) {
    const BSplineSurface<3> s = patch_surface(network, p);
    flux += integral(s.u(), s.u().first(), s.u().last(), [&](double u) {
      return integral(s.v(), s.v().first(), s.v().last(),
                      [&](double v) { return s.at(u, v).dot(normal_vector(s, u, v)); });
    });
  }
  for (const Rim& rim : network.rims) {
    double area = 0;
    for (const Side& side : rim.sides) {
      const BSplineSurface<3> s = patch_surface(network, side.patch);
      const Patch& patch = network.patches[static_cast<std::size_t>(side.patch)];
      const bool along_v = side.side == PatchSide::kU0 || side.side == PatchSide::kU1;
      const auto swept = [&](double t) {
        const Vec2 uv = side_parameters(patch, side.side, t);
        const Vec3 x = s.at(uv.x(), uv.y()) - rim.center_mm;
        return x.cross(s.at(uv.x(), uv.y(), along_v ? 0 : 1, along_v ? 1 : 0)).dot(rim.normal) / 2;
      };
      area += std::abs(integral(along_v ? patch.v : patch.u, side.from, side.to, swept));
    }
    flux += area * rim.center_mm.dot(rim.normal);
  }
  return flux / 3;
}

// Least (Su x Sv) length over its mean on the same patch, over all patches.
inline double least_jacobian_ratio(const SurfaceNetwork& network, int samples = 13) {
  double least = 1;
  for (int p = 0; p < static_cast<int>(network.patches.size()); ++p) {
    const BSplineSurface<3> s = patch_surface(network, p);
    double smallest = std::numeric_limits<double>::infinity();
    double sum = 0;
    for (int i = 0; i < samples; ++i) {
      for (int j = 0; j < samples; ++j) {
        const double u = s.u().first() + (s.u().last() - s.u().first()) * i / (samples - 1);
        const double v = s.v().first() + (s.v().last() - s.v().first()) * j / (samples - 1);
        const double area = normal_vector(s, u, v).norm();
        smallest = std::min(smallest, area);
        sum += area;
      }
    }
    least = std::min(least, smallest / (sum / (samples * samples)));
  }
  return least;
}

}  // namespace angiospline::testing
