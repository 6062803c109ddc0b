#include "modeling/junction/quality.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Dense>
#include <fmt/core.h>

#include "base/index.h"
#include "kernel/geometry/triangle_crossing.h"
#include "kernel/spline/basis.h"

namespace angiospline {
namespace {

constexpr int kGrid = 13;
constexpr int kEdgeSamples = 33;
constexpr int kSize = 6;
constexpr int kPoints = 36;
constexpr double kDegrees = 180 / std::numbers::pi;

constexpr double kWorstAngleDeg = 1e-3;
constexpr double kLeastJacobianRatio = 0.03;
constexpr double kMostOffTargetDeg = 60;
constexpr double kFairCurvature = 20;
constexpr double kFairDistance = 0.5;
constexpr double kGoodAngleDeg = 1e-6;
constexpr double kGoodCurvature = 8;  // gentle enough whatever the target
constexpr double kGoodOffTarget = 0.15;
constexpr double kSharperThanTarget = 1.2;
constexpr double kStep = 1e-4;  // of differences of normals, in smallest radii

using PatchPoints = Eigen::Matrix<double, 3, kPoints>;

struct Derivatives {
  Vec3 s, su, sv, suu, suv, svv;
};

// Rows 0 to 2 of the quintic Bernstein basis and its derivatives at n equal steps over [0, 1].
std::vector<Eigen::Matrix<double, 3, kSize>> basis_table(int count) {
  const KnotVector knots = KnotVector::bezier(kSize - 1);
  std::vector<Eigen::Matrix<double, 3, kSize>> table;
  for (int k = 0; k < count; ++k) {
    table.push_back(basis_at(knots, static_cast<double>(k) / (count - 1), 2).values);
  }
  return table;
}

Derivatives evaluate(const PatchPoints& P, const Eigen::Matrix<double, 3, kSize>& u,
                     const Eigen::Matrix<double, 3, kSize>& v) {
  Eigen::Matrix3d rows[3];  // derivative in v of order d, column per ... summed over u below
  for (auto& m : rows) m.setZero();
  for (int i = 0; i < kSize; ++i) {
    const Eigen::Matrix3d line = P.middleCols<kSize>(i * kSize) * v.transpose();
    rows[0] += u(0, i) * line;
    rows[1] += u(1, i) * line;
    rows[2] += u(2, i) * line;
  }
  return {rows[0].col(0), rows[1].col(0), rows[0].col(1),
          rows[2].col(0), rows[1].col(1), rows[0].col(2)};
}

double largest_curvature(const Derivatives& d, const Vec3& n) {
  const double E = d.su.squaredNorm(), F = d.su.dot(d.sv), G = d.sv.squaredNorm();
  const double L = n.dot(d.suu), M = n.dot(d.suv), N = n.dot(d.svv);
  const double area = E * G - F * F;
  const double H = (E * N - 2 * F * M + G * L) / (2 * area);
  const double K = (L * N - M * M) / area;
  return std::abs(H) + std::sqrt(std::max(0.0, H * H - K));
}

// Of the level set of the target through x, by differences of its normals.
double target_curvature(const JunctionTarget& target, const Vec3& x, double step) {
  const Vec3 n = target.foot(x).normal;
  const Vec3 a = n.unitOrthogonal();
  const Vec3 b = n.cross(a);
  const auto slope = [&](const Vec3& d) {
    return Vec3((target.foot(x + step * d).normal - target.foot(x - step * d).normal) / (2 * step));
  };
  const Vec3 da = slope(a);
  const Vec3 db = slope(b);
  const double H = (a.dot(da) + b.dot(db)) / 2;
  const double K = a.dot(da) * b.dot(db) - a.dot(db) * b.dot(da);
  return std::abs(H) + std::sqrt(std::max(0.0, H * H - K));
}

// Whether triangles over the nodes of all patches, which share those on their edges, cross.
bool meets_itself(const Points3& nodes, const SharedGrid& grid, int patches) {
  std::vector<std::array<int, 3>> triangles;
  for (int p = 0; p < patches; ++p) {
    for (int i = 0; i + 1 < kGrid; ++i) {
      for (int j = 0; j + 1 < kGrid; ++j) {
        triangles.push_back({grid.at(p, i, j), grid.at(p, i + 1, j), grid.at(p, i + 1, j + 1)});
        triangles.push_back({grid.at(p, i, j), grid.at(p, i + 1, j + 1), grid.at(p, i, j + 1)});
      }
    }
  }
  const std::vector<int> groups(triangles.size(), 0);
  return !crossing_triangles(nodes, triangles, groups).empty();
}

double angle_deg(const Vec3& a, const Vec3& b) {
  return kDegrees * std::atan2(a.cross(b).norm(), a.dot(b));
}

PatchPoints patch_points(const JunctionNet& net, int patch) {
  PatchPoints points;
  for (int k = 0; k < kPoints; ++k) {
    points.col(k) = net.points.col(net.grid.at(patch, k / kSize, k % kSize));
  }
  return points;
}

// Without a target there is nothing to be off from, and lengths are in the net's unit.
JunctionQuality measure(const JunctionTopology& topology, const JunctionTarget* target,
                        const JunctionNet& net) {
  static const auto kGridBasis = basis_table(kGrid);
  static const auto kEdgeBasis = basis_table(kEdgeSamples);
  const int patches = static_cast<int>(topology.patches.size());
  std::vector<PatchPoints> P(index(patches));
  for (int p = 0; p < patches; ++p) P[index(p)] = patch_points(net, p);
  const double smallest = *std::min_element(net.scale.begin(), net.scale.end());

  JunctionQuality q;
  q.jacobian_ratio = 1;
  bool star_shaped = true;
  const SharedGrid grid(topology, kGrid);
  Points3 nodes(3, grid.count());
  for (int p = 0; p < patches; ++p) {
    double least = std::numeric_limits<double>::infinity();
    double sum = 0;
    for (int i = 0; i < kGrid; ++i) {
      for (int j = 0; j < kGrid; ++j) {
        const Derivatives d = evaluate(P[index(p)], kGridBasis[index(i)], kGridBasis[index(j)]);
        const Vec3 cross = d.su.cross(d.sv);
        const double area = cross.norm();
        const Vec3 n = cross / area;
        least = std::min(least, area);
        sum += area;
        nodes.col(grid.at(p, i, j)) = d.s;
        q.curvature_times_radius =
            std::max(q.curvature_times_radius, smallest * largest_curvature(d, n));
        if (target != nullptr) {
          const JunctionTarget::Foot foot = target->foot(d.s);
          q.normal_off_target_deg = std::max(q.normal_off_target_deg, angle_deg(n, foot.normal));
          q.off_target = std::max(q.off_target, std::abs(foot.distance) / smallest);
          q.distance_to_union =
              std::max(q.distance_to_union, std::abs(target->union_distance(d.s)) / smallest);
        }
        star_shaped = star_shaped && d.s.dot(n) > 0;
      }
    }
    q.jacobian_ratio = std::min(q.jacobian_ratio, least / (sum / (kGrid * kGrid)));
  }
  const auto normal = [&](int p, int a, int b) {
    const Derivatives d = evaluate(P[index(p)], kEdgeBasis[index(a)], kEdgeBasis[index(b)]);
    return Vec3(d.su.cross(d.sv));
  };
  const int last = kEdgeSamples - 1;
  for (int p = 0; p < patches; ++p) {
    const int next = topology.patches[index(p)].next;
    for (int k = 0; k <= last; ++k) {
      q.worst_angle_deg =
          std::max(q.worst_angle_deg, angle_deg(normal(p, k, last), normal(next, k, 0)));
    }
  }
  for (const JunctionSaddle& s : topology.saddles) {
    for (int k = 0; k <= last; ++k) {
      q.worst_angle_deg = std::max(q.worst_angle_deg, angle_deg(normal(s.patch_a, last, k),
                                                                normal(s.patch_b, last, last - k)));
    }
  }
  // A closed surface seen from the centre without turning its back meets itself nowhere.
  if (!star_shaped) q.self_intersecting = meets_itself(nodes, grid, patches);
  // Comparisons with NaN are false: make every such figure fail its gate.
  for (double* figure : {&q.worst_angle_deg, &q.normal_off_target_deg, &q.curvature_times_radius}) {
    if (!std::isfinite(*figure)) *figure = 1e300;
  }
  if (!net.points.allFinite()) q.worst_angle_deg = 180;
  return q;
}

}  // namespace

JunctionQuality junction_quality(const JunctionTopology& topology, const JunctionTarget& target,
                                 const JunctionNet& net) {
  JunctionQuality q = measure(topology, &target, net);
  if (!is_fair(q) || q.curvature_times_radius <= kGoodCurvature) return q;
  const double smallest = *std::min_element(net.scale.begin(), net.scale.end());
  const auto basis = basis_table(kGrid);
  for (int p = 0; p < static_cast<int>(topology.patches.size()); ++p) {
    const PatchPoints P = patch_points(net, p);
    for (int k = 0; k < kGrid * kGrid; ++k) {
      const Vec3 x = evaluate(P, basis[index(k / kGrid)], basis[index(k % kGrid)]).s;
      q.target_curvature =
          std::max(q.target_curvature, smallest * target_curvature(target, x, kStep * smallest));
    }
  }
  return q;
}

JunctionQuality junction_quality(const JunctionTopology& topology, const JunctionNet& net) {
  return measure(topology, nullptr, net);
}

Points3 junction_normals(const JunctionTopology& topology, const JunctionNet& net) {
  static const auto kGridBasis = basis_table(kGrid);
  const int patches = static_cast<int>(topology.patches.size());
  Points3 normals(3, patches * kGrid * kGrid);
  for (int p = 0; p < patches; ++p) {
    const PatchPoints P = patch_points(net, p);
    for (int k = 0; k < kGrid * kGrid; ++k) {
      const Derivatives d = evaluate(P, kGridBasis[index(k / kGrid)], kGridBasis[index(k % kGrid)]);
      normals.col(p * kGrid * kGrid + k) = d.su.cross(d.sv).normalized();
    }
  }
  return normals;
}

bool is_sound(const JunctionQuality& q) { return failed_gate(q).empty(); }

bool is_fair(const JunctionQuality& q) {
  return is_sound(q) && q.curvature_times_radius < kFairCurvature &&
         q.distance_to_union < kFairDistance;
}

double departure(const JunctionQuality& q) {
  if (!is_fair(q)) {
    return std::max(q.curvature_times_radius / kFairCurvature, q.distance_to_union / kFairDistance);
  }
  return std::max(q.curvature_times_radius / kGoodCurvature, q.off_target / kGoodOffTarget);
}

bool is_faithful(const JunctionQuality& q, double most) {
  return is_fair(q) && q.worst_angle_deg <= kGoodAngleDeg && q.off_target <= kGoodOffTarget &&
         q.curvature_times_radius <=
             (q.target_curvature > most ? kSharperThanTarget * q.target_curvature : most);
}

std::string failed_gate(const JunctionQuality& q) {
  if (!(q.jacobian_ratio > kLeastJacobianRatio)) {
    return fmt::format("a patch is folded: Jacobian ratio {:.3g}, at least {} is wanted",
                       q.jacobian_ratio, kLeastJacobianRatio);
  }
  if (!(q.normal_off_target_deg < kMostOffTargetDeg)) {
    return fmt::format("a patch is turned {:.3g} degrees from its target, at most {} is allowed",
                       q.normal_off_target_deg, kMostOffTargetDeg);
  }
  if (!(q.worst_angle_deg < kWorstAngleDeg)) {
    return fmt::format(
        "normals of neighbouring patches differ by {:.3g} degrees, at most {} is allowed",
        q.worst_angle_deg, kWorstAngleDeg);
  }
  if (q.self_intersecting) return "the surface meets itself";
  return {};
}

}  // namespace angiospline
