#include "tests/shapes/crafted_networks.h"

#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "kernel/spline/curve.h"

namespace angiospline::crafted {
namespace {

// Half a circle from (1, 0) to (-1, 0) by way of (0, 1), as a quintic.
constexpr double kA = 0.668198, kB = 1.265900, kC = 0.442084;
constexpr std::array<double, 6> kX{1, 1, kC, -kC, -1, -1};
constexpr std::array<double, 6> kY{0, kA, kB, kB, kA, 0};

Vec2 half_circle(int half, int k) {
  const double sign = half == 0 ? 1 : -1;
  return sign * Vec2(kX[static_cast<std::size_t>(k)], kY[static_cast<std::size_t>(k)]);
}

// Control points are shared when they lie at the same place, which the networks' exact
// symmetry makes true bit for bit (up to the sign of zero).
class Pool {
 public:
  int add(const Vec3& p) {
    const std::array<double, 3> key{p.x() + 0.0, p.y() + 0.0, p.z() + 0.0};
    const auto [at, fresh] = index_.try_emplace(key, static_cast<int>(points_.size()));
    if (fresh) points_.push_back(p);
    return at->second;
  }
  Points3 columns() const {
    Points3 result(3, static_cast<Eigen::Index>(points_.size()));
    for (std::size_t k = 0; k < points_.size(); ++k) {
      result.col(static_cast<Eigen::Index>(k)) = points_[k];
    }
    return result;
  }

 private:
  std::map<std::array<double, 3>, int> index_;
  std::vector<Vec3> points_;
};

Rim rim(std::string name, RimKind kind, const Vec3& center, const Vec3& normal, double radius,
        std::vector<Side> sides) {
  return {std::move(name), kind, center, normal, radius, std::move(sides)};
}

Side side(int patch, PatchSide which, double from = 0, double to = 1) {
  return {patch, which, from, to};
}

double axis_height(int k, double from, double to) { return from + (to - from) * k / 5.0; }

// x of the axis at a control row of a parabola (degree elevated) that is `bend` at mid length.
double axis_shift(int k, double bend) { return 4 * bend * (k / 5.0 - k * (k - 1) / 20.0); }

Patch bezier_patch(std::vector<int> control, int region) {
  return {KnotVector::bezier(5), KnotVector::bezier(5), std::move(control), region};
}

// Half of a Bezier polygon by de Casteljau.
std::array<std::array<Vec2, 6>, 2> halves(std::array<Vec2, 6> p) {
  std::array<std::array<Vec2, 6>, 2> result;
  for (std::size_t k = 0; k < 6; ++k) {
    result[0][k] = p[0];
    result[1][5 - k] = p[5 - k];
    for (std::size_t i = 0; i + 1 < 6 - k; ++i) p[i] = 0.5 * (p[i] + p[i + 1]);
  }
  return result;
}

SurfaceNetwork tube_of(double radius, double length, double bend, double flare) {
  SurfaceNetwork network;
  Pool pool;
  network.regions = {{"wall_1", RegionKind::kBody, radius}};
  for (int half = 0; half < 2; ++half) {
    std::vector<int> control;
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) {
        const Vec2 c = radius * (1 + flare * j / 5.0) * half_circle(half, i);
        control.push_back(
            pool.add({c.x() + axis_shift(j, bend), c.y(), axis_height(j, 0, length)}));
      }
    }
    network.patches.push_back(bezier_patch(std::move(control), 0));
  }
  network.control_points_mm = pool.columns();
  network.joins = {{side(0, PatchSide::kU1), side(1, PatchSide::kU0), false},
                   {side(1, PatchSide::kU1), side(0, PatchSide::kU0), false}};
  network.rims = {rim("inlet", RimKind::kInlet, Vec3::Zero(), -Vec3::UnitZ(), radius,
                      {side(0, PatchSide::kV0), side(1, PatchSide::kV0)}),
                  rim("outlet_2", RimKind::kOutlet, {axis_shift(5, bend), 0, length}, Vec3::UnitZ(),
                      radius, {side(0, PatchSide::kV1), side(1, PatchSide::kV1)})};
  return network;
}

}  // namespace

SurfaceNetwork sheared_tube(double radius_mm, double length_mm, double bend_mm) {
  return tube_of(radius_mm, length_mm, bend_mm, 0.0);
}

SurfaceNetwork tube_of_quarters(double radius_mm, double length_mm) {
  SurfaceNetwork network = sheared_tube(radius_mm, length_mm / 2);
  network.rims.pop_back();
  network.regions.push_back({"wall_2", RegionKind::kBody, radius_mm});
  std::map<std::array<double, 3>, int> shared;
  std::vector<Vec3> added;
  const auto point = [&](const Vec3& p) {
    const auto [at, fresh] =
        shared.try_emplace({p.x() + 0.0, p.y() + 0.0, p.z() + 0.0},
                           static_cast<int>(network.control_points_mm.cols() + added.size()));
    if (fresh) added.push_back(p);
    return at->second;
  };
  for (int half = 0; half < 2; ++half) {
    std::array<Vec2, 6> polygon;
    for (int i = 0; i < 6; ++i)
      polygon[static_cast<std::size_t>(i)] = radius_mm * half_circle(half, i);
    for (const std::array<Vec2, 6>& quarter : halves(polygon)) {
      std::vector<int> control;
      for (const Vec2& c : quarter) {
        for (int j = 0; j < 6; ++j) {
          control.push_back(point({c.x(), c.y(), axis_height(j, length_mm / 2, length_mm)}));
        }
      }
      network.patches.push_back(bezier_patch(std::move(control), 1));
    }
  }
  const Eigen::Index before = network.control_points_mm.cols();
  network.control_points_mm.conservativeResize(Eigen::NoChange,
                                               before + static_cast<Eigen::Index>(added.size()));
  for (std::size_t k = 0; k < added.size(); ++k) {
    network.control_points_mm.col(before + static_cast<Eigen::Index>(k)) = added[k];
  }
  Rim outlet = rim("outlet_2", RimKind::kOutlet, {0, 0, length_mm}, Vec3::UnitZ(), radius_mm, {});
  for (int q = 0; q < 4; ++q) {
    network.joins.push_back(
        {side(2 + q, PatchSide::kU1), side(2 + (q + 1) % 4, PatchSide::kU0), false});
    const double from = q % 2 == 0 ? 0.0 : 0.5;
    network.joins.push_back(
        {side(q / 2, PatchSide::kV1, from, from + 0.5), side(2 + q, PatchSide::kV0), false});
    outlet.sides.push_back(side(2 + q, PatchSide::kV1));
  }
  network.rims.push_back(outlet);
  return network;
}

SurfaceNetwork one_patch_tube(double radius_mm, double length_mm) {
  SurfaceNetwork network;
  Pool pool;
  network.regions = {{"wall_1", RegionKind::kBody, radius_mm}};
  std::vector<int> control;
  for (int i = 0; i <= 10; ++i) {
    for (int j = 0; j < 6; ++j) {
      const Vec2 c = radius_mm * (i <= 5 ? half_circle(0, i) : half_circle(1, i - 5));
      control.push_back(pool.add({c.x(), c.y(), axis_height(j, 0, length_mm)}));
    }
  }
  network.patches = {
      {KnotVector::clamped(5, {0, 0.5, 1}, 5), KnotVector::bezier(5), std::move(control), 0}};
  network.control_points_mm = pool.columns();
  network.joins = {{side(0, PatchSide::kU0), side(0, PatchSide::kU1), false}};
  network.rims = {rim("inlet", RimKind::kInlet, Vec3::Zero(), -Vec3::UnitZ(), radius_mm,
                      {side(0, PatchSide::kV0)}),
                  rim("outlet_2", RimKind::kOutlet, {0, 0, length_mm}, Vec3::UnitZ(), radius_mm,
                      {side(0, PatchSide::kV1)})};
  return network;
}

SurfaceNetwork creased_tube(double radius_mm, double length_mm, double crease_deg) {
  const double flare = std::tan(crease_deg * std::numbers::pi / 180) * (length_mm / 2) / radius_mm;
  SurfaceNetwork lower = tube_of(radius_mm, length_mm / 2, 0.0, 0.0);
  SurfaceNetwork upper = tube_of(radius_mm, length_mm / 2, 0.0, flare);
  upper.control_points_mm.row(2).array() += length_mm / 2;
  lower.rims.pop_back();
  upper.rims.erase(upper.rims.begin());
  upper.rims.front().center_mm.z() = length_mm;
  upper.rims.front().radius_mm *= 1 + flare;
  upper.regions.front().name = "wall_2";
  append(lower, upper);
  // The upper part's first row is the lower part's last one.
  for (int half = 0; half < 2; ++half) {
    for (int i = 0; i < 6; ++i) {
      lower.patches[static_cast<std::size_t>(2 + half)].control[static_cast<std::size_t>(6 * i)] =
          lower.patches[static_cast<std::size_t>(half)]
              .control[static_cast<std::size_t>(6 * i + 5)];
    }
    lower.joins.push_back({side(half, PatchSide::kV1), side(2 + half, PatchSide::kV0), false});
  }
  return lower;
}

double unit_disc_area() {
  // Area under the two halves: the integral of (x dy - y dx) / 2, a polynomial of degree 9, by
  // Gauss's rule of five points, which is exact for it.
  constexpr std::array<double, 5> nodes{-0.9061798459386640, -0.5384693101056831, 0,
                                        0.5384693101056831, 0.9061798459386640};
  constexpr std::array<double, 5> weights{0.2369268850561891, 0.4786286704993665,
                                          0.5688888888888889, 0.4786286704993665,
                                          0.2369268850561891};
  Eigen::Matrix<double, 2, Eigen::Dynamic> polygon(2, 6);
  for (int i = 0; i < 6; ++i) polygon.col(i) = half_circle(0, i);
  const BSplineCurve<2> curve(KnotVector::bezier(5), polygon);
  double area = 0;
  for (std::size_t k = 0; k < 5; ++k) {
    const double t = 0.5 * (1 + nodes[k]);
    const Vec2 p = curve.at(t);
    const Vec2 d = curve.at(t, 1);
    area += 0.5 * weights[k] * (p.x() * d.y() - p.y() * d.x());  // two halves, each a half of it
  }
  return area;
}

}  // namespace angiospline::crafted
