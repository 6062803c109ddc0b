#include "modeling/check/fidelity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "base/index.h"
#include "kernel/evaluate/closest_point.h"
#include "modeling/check/rules.h"

namespace angiospline {
namespace {

using namespace check_rules;

// The strips of one tube, in their order around it; u runs along the branch.
struct Tube {
  std::vector<BSplineSurface<3>> strips;
  bool joined_start = false;  // goes on beyond, in a junction
  bool joined_end = false;
};

// Strips follow each other where side v1 of one is side v0 of the next.
std::map<std::string, std::vector<Tube>> tubes_by_region(const SurfaceNetwork& network) {
  std::vector<int> next(network.patches.size(), -1);
  std::vector<std::array<bool, 2>> joined(network.patches.size(), {false, false});
  for (const Join& join : network.joins) {
    for (const auto& [own, other] : {std::pair{join.a, join.b}, {join.b, join.a}}) {
      if (own.side == PatchSide::kV1 && other.side == PatchSide::kV0) {
        next[index(own.patch)] = other.patch;
      }
      if (own.side == PatchSide::kU0) joined[index(own.patch)][0] = true;
      if (own.side == PatchSide::kU1) joined[index(own.patch)][1] = true;
    }
  }

  // Round each body until the first strip comes again.
  std::map<std::string, std::vector<Tube>> tubes;
  std::vector<char> seen(network.patches.size(), 0);
  for (std::size_t p = 0; p < network.patches.size(); ++p) {
    const Region& region = network.regions[index(network.patches[p].region)];
    if (region.kind != RegionKind::kBody || seen[p] != 0) continue;
    Tube tube;
    int strip = static_cast<int>(p);
    while (strip >= 0 && seen[index(strip)] == 0) {
      seen[index(strip)] = 1;
      tube.strips.push_back(patch_surface(network, strip));
      strip = next[index(strip)];
    }
    if (strip != static_cast<int>(p)) continue;  // does not close: not a tube
    tube.joined_start = joined[p][0];
    tube.joined_end = joined[p][1];
    tubes[region.name].push_back(std::move(tube));
  }
  return tubes;
}

Vec3 ring_centroid(const Tube& tube, double u) {
  Vec3 sum = Vec3::Zero();
  int count = 0;
  for (const BSplineSurface<3>& strip : tube.strips) {
    for (int k = 0; k < kRingPoints; ++k, ++count) sum += strip.at(u, (k + 0.5) / kRingPoints);
  }
  return sum / count;
}

struct Section {
  double radius_mm;
  Vec3 centroid_mm;
};

// Where the plane through `place` across `tangent` cuts the tube near parameter `u`: nothing if it
// leaves the tube.
std::optional<Section> cut(const Tube& tube, double u, const Vec3& place, const Vec3& tangent) {
  const int each =
      std::max(kLeastStripPoints, kSectionPoints / static_cast<int>(tube.strips.size()));
  std::vector<Vec3> ring;
  for (const BSplineSurface<3>& strip : tube.strips) {
    for (int k = 0; k < each; ++k) {
      const double v = static_cast<double>(k) / each;

      // Newton's method along the strip's own line to the plane.
      double at = u;
      double height = 0;
      for (int step = 0; step < kNewtonSteps; ++step) {
        height = (strip.at(at, v) - place).dot(tangent);
        const double slope = strip.at(at, v, 1, 0).dot(tangent);
        if (!(slope > 0)) return std::nullopt;
        const double moved = std::clamp(at - height / slope, 0.0, 1.0);
        if (moved == at) break;
        at = moved;
      }
      const Vec3 point = strip.at(at, v);
      ring.push_back(point);
      if (std::abs(height) > kOnPlane * (point - place).norm()) return std::nullopt;
    }
  }

  Section section{0.0, Vec3::Zero()};
  for (const Vec3& p : ring) section.centroid_mm += p / static_cast<double>(ring.size());
  // The area in polar coordinates about the centroid: exact for a circle however its points lie.
  double area = 0;
  for (std::size_t k = 0; k < ring.size(); ++k) {
    const Vec3 a = ring[k] - section.centroid_mm;
    const Vec3 b = ring[(k + 1) % ring.size()] - section.centroid_mm;
    area += std::atan2(a.cross(b).norm(), a.dot(b)) * (a.squaredNorm() + b.squaredNorm()) / 4;
  }
  section.radius_mm = std::sqrt(area / std::numbers::pi);
  return section;
}

// Sums over the whole tree.
class Gauge {
 public:
  // Compares a tube with its path, about once a radius.
  void measure(const Tube& tube, const BSplineCurve<4>& path, const std::string& branch) {
    const double length = path.knots().last();
    double mean_radius = 0;
    for (const double part : {0.1, 0.3, 0.5, 0.7, 0.9})
      mean_radius += path.at(part * length)(3) / 5;

    // Rings along the tube tell which of its parameters is beside which of the path's.
    const int rings =
        std::max(kLeastRings, static_cast<int>(std::ceil(length / (kRingStep * mean_radius))));
    Points3 centroids(3, rings + 1);
    for (int k = 0; k <= rings; ++k) {
      centroids.col(k) = ring_centroid(tube, static_cast<double>(k) / rings);
    }
    const auto along = along_of(path, centroids);

    const int stations =
        std::max(kLeastStations, static_cast<int>(std::ceil(length / mean_radius)));
    for (int s = 1; s < stations; ++s) {
      const double t = length * s / stations;
      const Vec4 here = path.at(t);
      const auto above = std::lower_bound(along.begin(), along.end(), t);
      if (above == along.begin() || above == along.end()) continue;
      const auto k = above - along.begin();
      if ((centroids.col(k) - here.head<3>()).norm() > (kRingReach + kRingStep) * here(3)) continue;

      const double u = static_cast<double>(k) / rings;
      const auto section = cut(tube, u, here.head<3>(), path.at(t, 1).head<3>().normalized());
      if (!section) {
        ++result_.missed;
        continue;
      }
      const double clear = kNearJunction * here(3);
      const bool near = (tube.joined_start && t - along.front() < clear) ||
                        (tube.joined_end && along.back() - t < clear);
      add(*section, here, near, branch);
    }
  }

  // How far smoothing moved the points of a branch, and then keeping vessels apart its path.
  void measure_moves(const SmoothedTree& tree, std::size_t b) {
    const CenterlineBranch& branch = tree.tree.branches[b];
    Eigen::Matrix4Xd points(4, branch.points_mm.cols());
    points << branch.points_mm, branch.radii_mm.transpose();
    if (!tree.given.empty()) points = tree.given[b];
    const BSplineCurve<4>& path = tree.paths[b];
    const bool kept_apart = !tree.before_clearance.empty();
    const BSplineCurve<4>& smoothed = kept_apart ? tree.before_clearance[b] : path;

    const std::vector<double> moves = moves_from(points, smoothed);
    const std::vector<double> total = kept_apart ? moves_from(points, path) : moves;
    for (std::size_t i = 0; i < moves.size(); ++i) {
      const double radius = points(3, static_cast<Eigen::Index>(i));
      moves_ += moves[i] / radius;
      ++points_;
      result_.largest_move_mm = std::max(result_.largest_move_mm, moves[i]);
      result_.largest_total_move_mm = std::max(result_.largest_total_move_mm, total[i]);
      take_larger(moves[i] / radius, branch.name, result_.largest_move_radii,
                  result_.largest_move_branch);
      take_larger(total[i] / radius, branch.name, result_.largest_total_move_radii,
                  result_.largest_total_move_branch);
    }
    if (!kept_apart) return;

    const int count = kClearanceSamples * path.knots().control_point_count();
    for (int k = 0; k <= count; ++k) {
      const double t = path.knots().last() * k / count;
      const Vec4 before = smoothed.at(t);
      take_larger((path.at(t) - before).head<3>().norm() / before(3), branch.name,
                  result_.largest_clearance_move_radii, result_.largest_clearance_move_branch);
    }
  }

  Fidelity result() const {
    Fidelity f = result_;
    const int away = f.sections - f.near_junctions;
    if (away > 0) f.mean_radius_error /= away;
    if (f.sections > 0) f.mean_axis_offset /= f.sections;
    if (points_ > 0) f.mean_move_radii = moves_ / points_;
    return f;
  }

 private:
  // The path's parameter (nearly its arc length) beside each centroid, never decreasing.
  static std::vector<double> along_of(const BSplineCurve<4>& path, const Points3& centroids) {
    const double length = path.knots().last();
    const BSplineCurve<3> axis(path.knots(), path.control_points().topRows<3>());
    std::vector<double> along;
    double t = 0;
    for (Eigen::Index k = 0; k < centroids.cols(); ++k) {
      const double step = k > 0 ? (centroids.col(k) - centroids.col(k - 1)).norm() : 0.0;
      // From where it was; the first is looked for over the whole path.
      t = k == 0
              ? closest_point(axis, Vec3(centroids.col(0))).t
              : std::max(
                    t,
                    closest_point_from(axis, Vec3(centroids.col(k)), std::min(length, t + step)).t);
      along.push_back(t);
    }
    return along;
  }

  static void take_larger(double value, const std::string& branch, double& largest,
                          std::string& of_branch) {
    if (value <= largest) return;
    largest = value;
    of_branch = branch;
  }

  // The distance of each point (x, y, z, radius) from the path near its own share of the way.
  static std::vector<double> moves_from(const Eigen::Matrix4Xd& points,
                                        const BSplineCurve<4>& path) {
    const BSplineCurve<3> axis(path.knots(), path.control_points().topRows<3>());
    std::vector<double> along{0.0};
    for (Eigen::Index i = 1; i < points.cols(); ++i) {
      along.push_back(along.back() + (points.col(i) - points.col(i - 1)).head<3>().norm());
    }

    const double scale = along.back() > 0 ? path.knots().last() / along.back() : 0.0;
    std::vector<double> moves;
    for (Eigen::Index i = 0; i < points.cols(); ++i) {
      const double start = std::min(path.knots().last(), scale * along[moves.size()]);
      moves.push_back(nearest(axis, points.col(i).head<3>(), start));
    }
    return moves;
  }

  // The nearest of some local minima around the start.
  static double nearest(const BSplineCurve<3>& axis, const Vec3& point, double start) {
    double best = std::numeric_limits<double>::infinity();
    const double window = kSearchWindow * axis.knots().last();
    for (const double shift : kSearchShifts) {
      const double from = std::clamp(start + shift * window, 0.0, axis.knots().last());
      best = std::min(best, closest_point_from(axis, point, from).distance);
    }
    return best;
  }

  void add(const Section& section, const Vec4& here, bool near, const std::string& branch) {
    const double error = std::abs(section.radius_mm - here(3)) / here(3);
    const double offset = (section.centroid_mm - here.head<3>()).norm() / here(3);
    ++result_.sections;
    result_.mean_axis_offset += offset;
    if (offset > result_.largest_axis_offset) {
      result_.largest_axis_offset = offset;
      result_.largest_offset_branch = branch;
    }

    // Beside a junction the tube is blended into it, and its radius need not be the path's.
    if (near) {
      ++result_.near_junctions;
      result_.largest_radius_error_near_junctions =
          std::max(result_.largest_radius_error_near_junctions, error);
      return;
    }

    result_.mean_radius_error += error;
    if (error > kFarOff) ++result_.far_off;
    if (error > result_.largest_radius_error) {
      result_.largest_radius_error = error;
      result_.largest_error_branch = branch;
      result_.largest_error_at_mm = here.head<3>();
    }
  }

  Fidelity result_;
  double moves_ = 0.0;
  int points_ = 0;
};

}  // namespace

Fidelity measure_fidelity(const SurfaceNetwork& network, const SmoothedTree& tree) {
  const auto tubes = tubes_by_region(network);
  Gauge gauge;
  for (std::size_t b = 0; b < tree.paths.size(); ++b) {
    const CenterlineBranch& branch = tree.tree.branches[b];
    gauge.measure_moves(tree, b);
    const auto found = tubes.find("wall_" + branch.name);
    if (found == tubes.end()) continue;
    for (const Tube& tube : found->second) gauge.measure(tube, tree.paths[b], branch.name);
  }
  return gauge.result();
}

std::string to_text(const Fidelity& f) {
  const auto name = [](const std::string& branch) { return branch.empty() ? "-" : branch; };
  std::string text = fmt::format(
      "radius           {:.2g} % off the smoothed one in the mean, {:.2g} % at most away from "
      "junctions ({}); {} of {} sections are more than 5 % off\n"
      "centerline       moved by smoothing: {:.2g} radii in the mean, {:.2g} at most ({}; {:.3g} "
      "mm)",
      100 * f.mean_radius_error, 100 * f.largest_radius_error, name(f.largest_error_branch),
      f.far_off, f.sections - f.near_junctions, f.mean_move_radii, f.largest_move_radii,
      name(f.largest_move_branch), f.largest_move_mm);
  if (f.largest_clearance_move_radii > 0) {
    text += fmt::format(
        ", by the clearance: {:.2g} at most ({}), by both together: {:.2g} at most ({}; {:.3g} mm)",
        f.largest_clearance_move_radii, f.largest_clearance_move_branch, f.largest_total_move_radii,
        name(f.largest_total_move_branch), f.largest_total_move_mm);
  }
  return text +
         fmt::format("; the model's axis is {:.2g} radii off it in the mean, {:.2g} at most ({})",
                     f.mean_axis_offset, f.largest_axis_offset, name(f.largest_offset_branch));
}

}  // namespace angiospline
