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
#include "modeling/junction/patch_basis.h"
#include "modeling/junction/rules.h"

namespace angiospline {
namespace {

using namespace junction_rules;

constexpr int kGrid = kQualityGrid;
constexpr double kDegrees = 180 / std::numbers::pi;

struct Derivatives {
  Vec3 s, su, sv, suu, suv, svv;
};

// Rows 0 to 2 of the quintic Bernstein basis and its derivatives at n equal steps over [0, 1].
std::vector<Eigen::Matrix<double, 3, kPatchSize>> basis_table(int count) {
  const KnotVector knots = KnotVector::bezier(kPatchSize - 1);
  std::vector<Eigen::Matrix<double, 3, kPatchSize>> table;
  for (int k = 0; k < count; ++k) {
    table.push_back(basis_at(knots, static_cast<double>(k) / (count - 1), 2).values);
  }
  return table;
}

Derivatives evaluate(const PatchNet& P, const Eigen::Matrix<double, 3, kPatchSize>& u,
                     const Eigen::Matrix<double, 3, kPatchSize>& v) {
  Eigen::Matrix3d rows[3];  // row: order of the derivative in u; column: of that in v
  for (auto& m : rows) m.setZero();
  for (int i = 0; i < kPatchSize; ++i) {
    const Eigen::Matrix3d line = P.middleCols<kPatchSize>(i * kPatchSize) * v.transpose();
    rows[0] += u(0, i) * line;
    rows[1] += u(1, i) * line;
    rows[2] += u(2, i) * line;
  }
  return {rows[0].col(0), rows[1].col(0), rows[0].col(1),
          rows[2].col(0), rows[1].col(1), rows[0].col(2)};
}

double largest_curvature(const Derivatives& d, const Vec3& n) {
  // The first and second fundamental forms; mean and Gaussian curvature from both (do Carmo:
  // Differential Geometry of Curves and Surfaces, 3.3).
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

// All that measures look at: a net's patches, and lengths in its smallest radius.
struct Measured {
  const JunctionTopology& topology;
  const JunctionTarget* target;  // null: there is nothing to be off from
  std::vector<PatchNet> patches;
  double smallest;

  Measured(const JunctionTopology& t, const JunctionTarget* to, const JunctionNet& net)
      : topology(t), target(to), smallest(*std::min_element(net.scale.begin(), net.scale.end())) {
    for (int p = 0; p < static_cast<int>(t.patches.size()); ++p) {
      patches.push_back(patch_net(net, p));
    }
  }
};

// The largest of what a target says about one place of the surface.
void measure_against(const JunctionTarget& target, const Vec3& x, const Vec3& n, double smallest,
                     JunctionQuality& q) {
  const JunctionTarget::Foot foot = target.foot(x);
  q.normal_off_target_deg = std::max(q.normal_off_target_deg, angle_deg(n, foot.normal));
  q.off_target = std::max(q.off_target, std::abs(foot.distance) / smallest);
  q.distance_to_union =
      std::max(q.distance_to_union, std::abs(target.union_distance(x)) / smallest);
}

// Areas, curvatures and distances on a grid of every patch, and self-intersection.
void measure_faces(const Measured& m, JunctionQuality& q) {
  static const auto basis = basis_table(kGrid);
  const int patches = static_cast<int>(m.patches.size());
  const SharedGrid grid(m.topology, kGrid);
  Points3 nodes(3, grid.count());
  q.jacobian_ratio = 1;
  bool star_shaped = true;

  for (int p = 0; p < patches; ++p) {
    double least = std::numeric_limits<double>::infinity();
    double sum = 0;
    for (int i = 0; i < kGrid; ++i) {
      for (int j = 0; j < kGrid; ++j) {
        const Derivatives d = evaluate(m.patches[index(p)], basis[index(i)], basis[index(j)]);
        const Vec3 cross = d.su.cross(d.sv);
        const double area = cross.norm();
        const Vec3 n = cross / area;

        least = std::min(least, area);
        sum += area;
        nodes.col(grid.at(p, i, j)) = d.s;
        q.curvature_times_radius =
            std::max(q.curvature_times_radius, m.smallest * largest_curvature(d, n));
        if (m.target != nullptr) measure_against(*m.target, d.s, n, m.smallest, q);
        star_shaped = star_shaped && d.s.dot(n) > 0;
      }
    }
    q.jacobian_ratio = std::min(q.jacobian_ratio, least / (sum / (kGrid * kGrid)));
  }

  // A closed surface seen from the centre without turning its back meets itself nowhere.
  if (!star_shaped) q.self_intersecting = meets_itself(nodes, grid, patches);
}

// Angles between the normals of both patches along all inner edges.
void measure_edges(const Measured& m, JunctionQuality& q) {
  static const auto basis = basis_table(kQualityEdgeSamples);
  const auto normal = [&](int p, int a, int b) {
    const Derivatives d = evaluate(m.patches[index(p)], basis[index(a)], basis[index(b)]);
    return Vec3(d.su.cross(d.sv));
  };
  const auto meet = [&](const Vec3& a, const Vec3& b) {
    q.worst_angle_deg = std::max(q.worst_angle_deg, angle_deg(a, b));
  };

  const int last = kQualityEdgeSamples - 1;
  for (int p = 0; p < static_cast<int>(m.patches.size()); ++p) {
    const int next = m.topology.patches[index(p)].next;
    for (int k = 0; k <= last; ++k) meet(normal(p, k, last), normal(next, k, 0));
  }
  for (const JunctionSaddle& s : m.topology.saddles) {
    for (int k = 0; k <= last; ++k)
      meet(normal(s.patch_a, last, k), normal(s.patch_b, last, last - k));
  }
}

// Comparisons with NaN are false: makes every such figure fail its gate.
void gate_of_nan(const JunctionNet& net, JunctionQuality& q) {
  for (double* figure : {&q.worst_angle_deg, &q.normal_off_target_deg, &q.curvature_times_radius}) {
    if (!std::isfinite(*figure)) *figure = kNotANumber;
  }
  if (!net.points.allFinite()) q.worst_angle_deg = 180;
}

// Without a target there is nothing to be off from, and lengths are in the net's unit.
JunctionQuality measure(const JunctionTopology& topology, const JunctionTarget* target,
                        const JunctionNet& net) {
  const Measured measured(topology, target, net);
  JunctionQuality q;
  measure_faces(measured, q);
  measure_edges(measured, q);
  gate_of_nan(net, q);
  return q;
}

}  // namespace

JunctionQuality junction_quality(const JunctionTopology& topology, const JunctionTarget& target,
                                 const JunctionNet& net) {
  JunctionQuality q = measure(topology, &target, net);
  if (!is_fair(q) || q.curvature_times_radius <= kGates.good_curvature) return q;

  // Only where the surface is sharp does it matter how sharp its target is: differences are dear.
  const double smallest = *std::min_element(net.scale.begin(), net.scale.end());
  const auto basis = basis_table(kGrid);
  for (int p = 0; p < static_cast<int>(topology.patches.size()); ++p) {
    const PatchNet P = patch_net(net, p);
    for (int k = 0; k < kGrid * kGrid; ++k) {
      const Vec3 x = evaluate(P, basis[index(k / kGrid)], basis[index(k % kGrid)]).s;
      q.target_curvature = std::max(q.target_curvature,
                                    smallest * target_curvature(target, x, kNormalStep * smallest));
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
    const PatchNet P = patch_net(net, p);
    for (int k = 0; k < kGrid * kGrid; ++k) {
      const Derivatives d = evaluate(P, kGridBasis[index(k / kGrid)], kGridBasis[index(k % kGrid)]);
      normals.col(p * kGrid * kGrid + k) = d.su.cross(d.sv).normalized();
    }
  }
  return normals;
}

bool is_sound(const JunctionQuality& q) { return failed_gate(q).empty(); }

bool is_fair(const JunctionQuality& q) {
  return is_sound(q) && q.curvature_times_radius < kGates.fair_curvature &&
         q.distance_to_union < kGates.fair_distance;
}

double departure(const JunctionQuality& q) {
  if (!is_fair(q)) {
    return std::max(q.curvature_times_radius / kGates.fair_curvature,
                    q.distance_to_union / kGates.fair_distance);
  }
  return std::max(q.curvature_times_radius / kGates.good_curvature,
                  q.off_target / kGates.good_off_target);
}

bool is_faithful(const JunctionQuality& q, double most) {
  return is_fair(q) && q.worst_angle_deg <= kGates.good_angle_deg &&
         q.off_target <= kGates.good_off_target &&
         q.curvature_times_radius <=
             (q.target_curvature > most ? kGates.sharper_than_target * q.target_curvature : most);
}

std::string failed_gate(const JunctionQuality& q) {
  if (!(q.jacobian_ratio > kGates.least_jacobian_ratio)) {
    return fmt::format("a patch is folded: Jacobian ratio {:.3g}, at least {} is wanted",
                       q.jacobian_ratio, kGates.least_jacobian_ratio);
  }

  if (!(q.normal_off_target_deg < kGates.most_off_target_deg)) {
    return fmt::format("a patch is turned {:.3g} degrees from its target, at most {} is allowed",
                       q.normal_off_target_deg, kGates.most_off_target_deg);
  }

  if (!(q.worst_angle_deg < kGates.worst_angle_deg)) {
    return fmt::format(
        "normals of neighbouring patches differ by {:.3g} degrees, at most {} is allowed",
        q.worst_angle_deg, kGates.worst_angle_deg);
  }

  if (q.self_intersecting) return "the surface meets itself";
  return {};
}

}  // namespace angiospline
