#include "tests/shapes/sample_networks.h"

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>

#include "kernel/numerics/quadrature.h"

namespace angiospline::samples {
namespace {

// The quintic that is a half circle from (1, 0) over (0, 1) to (-1, 0) up to 1.74e-6.
constexpr double kA = 0.668198;
constexpr double kB = 1.265900;
constexpr double kC = 0.442084;
const std::array<Vec2, 6> kHalfCircle{Vec2(1, 0),    Vec2(1, kA),  Vec2(kC, kB),
                                      Vec2(-kC, kB), Vec2(-1, kA), Vec2(-1, 0)};

// Control point k of 10 round the whole circle: 0 .. 5 the upper half, 5 .. 10 = 0 the lower.
Vec2 ring_point(int k) {
  k %= 10;
  return k < 6 ? kHalfCircle[static_cast<std::size_t>(k)]
               : Vec2(-kHalfCircle[static_cast<std::size_t>(k - 5)]);
}

KnotVector axis_knots(int rows) {
  std::vector<double> breaks;
  for (int k = 0; k <= rows - 5; ++k) breaks.push_back(k);
  return KnotVector::clamped(5, breaks);
}

Rim rim(std::string name, RimKind kind, double z, double radius_mm, std::vector<Side> sides) {
  return {std::move(name), kind,
          Vec3(0, 0, z),   Vec3(0, 0, kind == RimKind::kInlet ? -1 : 1),
          radius_mm,       std::move(sides)};
}

struct Quadrature {
  std::vector<double> nodes;
  std::vector<double> weights;
};

// Eight points on every span: exact for degree 15.
Quadrature gauss(const KnotVector& knots) {
  const GaussRule rule = gauss_legendre(8);
  Quadrature q;
  const std::vector<double> breaks = knots.breakpoints();
  for (std::size_t i = 0; i + 1 < breaks.size(); ++i) {
    const double half = 0.5 * (breaks[i + 1] - breaks[i]);
    const double mid = 0.5 * (breaks[i + 1] + breaks[i]);
    for (Eigen::Index k = 0; k < rule.nodes.size(); ++k) {
      q.nodes.push_back(mid + half * rule.nodes[k]);
      q.weights.push_back(half * rule.weights[k]);
    }
  }
  return q;
}

template <typename Integrand>
double integrate(const SurfaceNetwork& network, const Integrand& integrand) {
  double sum = 0;
  for (int p = 0; p < static_cast<int>(network.patches.size()); ++p) {
    const BSplineSurface<3> surface = patch_surface(network, p);
    const Quadrature u = gauss(surface.u());
    const Quadrature v = gauss(surface.v());
    for (std::size_t i = 0; i < u.nodes.size(); ++i) {
      for (std::size_t j = 0; j < v.nodes.size(); ++j) {
        sum += u.weights[i] * v.weights[j] *
               integrand(surface.at(u.nodes[i], v.nodes[j]),
                         normal_vector(surface, u.nodes[i], v.nodes[j]));
      }
    }
  }
  return sum;
}

}  // namespace

SurfaceNetwork tube(double radius_mm, double length_mm, int rows) {
  SurfaceNetwork n;
  const KnotVector v = axis_knots(rows);
  n.control_points_mm.resize(3, 10 * rows);
  for (int k = 0; k < 10; ++k) {
    for (int j = 0; j < rows; ++j) {
      const Vec2 p = radius_mm * ring_point(k);
      n.control_points_mm.col(k * rows + j) << p.x(), p.y(), length_mm * v.greville(j) / v.last();
    }
  }
  n.regions.push_back({"wall_a", RegionKind::kBody, radius_mm});
  for (int half = 0; half < 2; ++half) {
    Patch patch{KnotVector::bezier(5), v, {}, 0};
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < rows; ++j) patch.control.push_back((half * 5 + i) % 10 * rows + j);
    }
    n.patches.push_back(std::move(patch));
  }
  const double last = v.last();
  n.joins.push_back({{0, PatchSide::kU1, 0, last}, {1, PatchSide::kU0, 0, last}, false});
  n.joins.push_back({{1, PatchSide::kU1, 0, last}, {0, PatchSide::kU0, 0, last}, false});
  n.rims.push_back(rim("inlet", RimKind::kInlet, 0, radius_mm,
                       {{0, PatchSide::kV0, 0, 1}, {1, PatchSide::kV0, 0, 1}}));
  n.rims.push_back(rim("outlet_end", RimKind::kOutlet, length_mm, radius_mm,
                       {{0, PatchSide::kV1, 0, 1}, {1, PatchSide::kV1, 0, 1}}));
  return n;
}

SurfaceNetwork tube_with_t_vertex(double radius_mm, double length_mm) {
  SurfaceNetwork n = tube(radius_mm, 0.4 * length_mm, 6);
  n.rims.pop_back();
  n.regions.push_back({"wall_b", RegionKind::kBody, radius_mm});
  // Rows of the upper part: its patches' columns in the pool, bottom row first.
  constexpr int kRows = 6;
  const auto bottom = [](int k) { return k % 10 * 6 + 5; };  // top row of the lower part
  const auto point = [&](const Vec3& p) {
    n.control_points_mm.conservativeResize(3, n.control_points_mm.cols() + 1);
    n.control_points_mm.rightCols(1) = p;
    return static_cast<int>(n.control_points_mm.cols()) - 1;
  };
  // De Casteljau at the middle of the upper half: weights of the six points of each part.
  std::array<std::array<double, 6>, 11> weight{};
  for (int i = 0; i < 6; ++i) {
    double binomial = 1;
    for (int k = 0; k <= i; ++k) {
      const double w = binomial / std::pow(2.0, i);
      weight[static_cast<std::size_t>(i)][static_cast<std::size_t>(k)] = w;
      weight[static_cast<std::size_t>(10 - i)][static_cast<std::size_t>(5 - k)] = w;
      binomial = binomial * (i - k) / (k + 1);
    }
  }
  const auto lift = [&](const Vec3& p, int j) {
    return Vec3(p.x(), p.y(), length_mm * (0.4 + 0.6 * j / (kRows - 1)));
  };
  // Columns of the split half (11 round) and of the whole half (6 round, two shared).
  std::vector<std::vector<int>> split(11);
  for (int k = 0; k < 11; ++k) {
    Vec3 combined = Vec3::Zero();
    Dependency dependency;
    for (int m = 0; m < 6; ++m) {
      const double w = weight[static_cast<std::size_t>(k)][static_cast<std::size_t>(m)];
      if (w == 0) continue;
      combined += w * n.control_points_mm.col(bottom(m));
      dependency.masters.emplace_back(bottom(m), w);
    }
    const bool corner = k == 0 || k == 10;
    auto& column = split[static_cast<std::size_t>(k)];
    column.push_back(corner ? bottom(k / 2) : point(combined));
    if (!corner) {
      dependency.point = column[0];
      n.dependencies.push_back(dependency);
    }
    for (int j = 1; j < kRows; ++j) column.push_back(point(lift(combined, j)));
  }
  std::vector<std::vector<int>> whole(6);
  whole[0] = split[10];
  whole[5] = split[0];
  for (int k = 1; k < 5; ++k) {
    auto& column = whole[static_cast<std::size_t>(k)];
    column.push_back(bottom(5 + k));
    const Vec3 base = n.control_points_mm.col(bottom(5 + k));
    for (int j = 1; j < kRows; ++j) column.push_back(point(lift(base, j)));
  }
  const auto add_patch = [&](const std::vector<std::vector<int>>& columns, int first) {
    Patch patch{KnotVector::bezier(5), KnotVector::bezier(5), {}, 1};
    for (int i = 0; i < 6; ++i) {
      const auto& column = columns[static_cast<std::size_t>(first + i)];
      patch.control.insert(patch.control.end(), column.begin(), column.end());
    }
    n.patches.push_back(std::move(patch));
  };
  add_patch(split, 0);  // 2
  add_patch(split, 5);  // 3
  add_patch(whole, 0);  // 4
  n.joins.push_back({{0, PatchSide::kV1, 0, 0.5}, {2, PatchSide::kV0, 0, 1}, false});
  n.joins.push_back({{0, PatchSide::kV1, 0.5, 1}, {3, PatchSide::kV0, 0, 1}, false});
  n.joins.push_back({{1, PatchSide::kV1, 0, 1}, {4, PatchSide::kV0, 0, 1}, false});
  for (int p = 2; p < 5; ++p) {
    n.joins.push_back(
        {{p, PatchSide::kU1, 0, 1}, {p == 4 ? 2 : p + 1, PatchSide::kU0, 0, 1}, false});
  }
  n.rims.push_back(
      rim("outlet_end", RimKind::kOutlet, length_mm, radius_mm,
          {{2, PatchSide::kV1, 0, 1}, {3, PatchSide::kV1, 0, 1}, {4, PatchSide::kV1, 0, 1}}));
  return n;
}

SurfaceNetwork torus(double ring_radius_mm, double tube_radius_mm) {
  SurfaceNetwork n;
  n.control_points_mm.resize(3, 100);
  for (int i = 0; i < 10; ++i) {    // round the ring
    for (int k = 0; k < 10; ++k) {  // round the tube
      const Vec2 ring = ring_point(i);
      const Vec2 around = ring_radius_mm * Vec2(1, 0) + tube_radius_mm * ring_point(k);
      n.control_points_mm.col(10 * i + k) << around.x() * ring.x(), around.x() * ring.y(),
          around.y();
    }
  }
  n.regions.push_back({"wall_ring", RegionKind::kBody, tube_radius_mm});
  for (int a = 0; a < 2; ++a) {
    for (int b = 0; b < 2; ++b) {
      Patch patch{KnotVector::bezier(5), KnotVector::bezier(5), {}, 0};
      for (int i = 0; i < 6; ++i) {
        for (int k = 0; k < 6; ++k) {
          patch.control.push_back((5 * a + i) % 10 * 10 + (5 * b + k) % 10);
        }
      }
      n.patches.push_back(std::move(patch));
    }
  }
  for (int k = 0; k < 2; ++k) {
    for (int s = 0; s < 2; ++s) {
      n.joins.push_back(
          {{2 * s + k, PatchSide::kU1, 0, 1}, {2 * (1 - s) + k, PatchSide::kU0, 0, 1}, false});
      n.joins.push_back(
          {{2 * k + s, PatchSide::kV1, 0, 1}, {2 * k + 1 - s, PatchSide::kV0, 0, 1}, false});
    }
  }
  return n;
}

SurfaceNetwork bent_tube() {
  SurfaceNetwork n = tube(1.0, 12.0, 12);
  // The ends are moved by rotations and shifts only, so that the rims stay plane.
  for (Eigen::Index c = 0; c < n.control_points_mm.cols(); ++c) {
    const Vec3 p = n.control_points_mm.col(c);
    const double s = p.z() / 12.0;
    const double angle = 1.5 * s;
    const double radius = 1.0 - 0.4 * s;
    const double bend = 7.0;
    const double x = bend - radius * p.x();
    n.control_points_mm.col(c) << bend - x * std::cos(angle), radius * p.y() + 2 * s * s,
        x * std::sin(angle);
  }
  for (Rim& rim : n.rims) {
    Vec3 sum = Vec3::Zero();
    Points3 points(3, 4);
    int k = 0;
    for (const Side& side : rim.sides) {
      for (const double t : {0.0, 0.5}) {
        const Vec2 uv =
            side_parameters(n.patches[static_cast<std::size_t>(side.patch)], side.side, t);
        points.col(k) = patch_surface(n, side.patch).at(uv.x(), uv.y());
        sum += points.col(k++);
      }
    }
    rim.center_mm = sum / 4;
    const Vec3 across =
        Vec3(points.col(2) - points.col(0)).cross(Vec3(points.col(3) - points.col(1)));
    rim.normal = across.normalized() * (rim.kind == RimKind::kInlet ? -1 : 1);
    rim.radius_mm = 0.5 * (points.col(2) - points.col(0)).norm();
  }
  return n;
}

Model model_of(SurfaceNetwork network) {
  Model model;
  model.name = "sample \"model\" \u00b5";
  model.network = std::move(network);
  model.tree.nodes = {{"1", Vec3(0, 0, 0)}, {"2", Vec3(0.1, 1.0 / 3.0, 5)}};
  CenterlineBranch branch{"a", 0, 1, Points3(3, 3), Eigen::VectorXd(3)};
  branch.points_mm << 0, 0.05, 0.1, 0, 1.0 / 6.0, 1.0 / 3.0, 0, 2.5, 5;
  branch.radii_mm << 1, 0.9999999999999999, std::numbers::pi / 3;
  model.tree.branches.push_back(std::move(branch));
  model.tree.inlets = {0};
  model.tree.assumptions = {"lengths are millimetres"};
  model.tree.source = "a.swc";
  model.assumptions = {"column 6 is the radius"};
  model.warnings = {{WarningCode::kBranchInsideLumen, "branch b is short"},
                    {WarningCode::kUnspecified, "told by a file without codes"}};
  model.failed = {{"junction_7", "two branches in the same direction"}};
  return model;
}

double exact_volume_mm3(const SurfaceNetwork& network) {
  double volume = integrate(network, [](const Vec3& s, const Vec3& n) { return s.dot(n) / 3; });
  for (const Rim& rim : network.rims) {  // area vector of the plane cap by the boundary's moment
    Vec3 area = Vec3::Zero();
    for (const Side& side : rim.sides) {
      const BSplineSurface<3> surface = patch_surface(network, side.patch);
      const bool along_v = side.side == PatchSide::kU0 || side.side == PatchSide::kU1;
      const Quadrature q = gauss(along_v ? surface.v() : surface.u());
      for (std::size_t k = 0; k < q.nodes.size(); ++k) {
        const Vec2 uv = side_parameters(network.patches[static_cast<std::size_t>(side.patch)],
                                        side.side, q.nodes[k]);
        const Vec3 p = surface.at(uv.x(), uv.y()) - rim.center_mm;
        const Vec3 d = surface.at(uv.x(), uv.y(), along_v ? 0 : 1, along_v ? 1 : 0);
        area += 0.5 * q.weights[k] * p.cross(d);
      }
    }
    volume += rim.center_mm.dot(rim.normal) * std::abs(area.dot(rim.normal)) / 3;
  }
  return volume;
}

double wall_area_mm2(const SurfaceNetwork& network) {
  return integrate(network, [](const Vec3&, const Vec3& n) { return n.norm(); });
}

}  // namespace angiospline::samples
