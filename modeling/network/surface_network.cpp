#include "modeling/network/surface_network.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/index.h"

namespace angiospline {
namespace {

const KnotVector& side_knots(const Patch& patch, PatchSide side) {
  return side == PatchSide::kU0 || side == PatchSide::kU1 ? patch.v : patch.u;
}

Vec3 side_point(const SurfaceNetwork& network, const Side& side, double t) {
  const Patch& patch = network.patches[index(side.patch)];
  const Vec2 uv = side_parameters(patch, side.side, t);
  return patch_surface(network, side.patch).at(uv.x(), uv.y());
}

Error defect(std::string what, std::string where, std::string value, std::string rule) {
  return Error{ErrorKind::kBadInput, std::move(what), std::move(where), std::move(value),
               std::move(rule)};
}

std::string patch_name(const SurfaceNetwork& network, int patch) {
  const int region = network.patches[index(patch)].region;
  return "patch " + std::to_string(patch) + " of " + network.regions[index(region)].name;
}

std::optional<Error> find_patch_defect(const SurfaceNetwork& network, int number) {
  const Patch& patch = network.patches[index(number)];
  const std::string where = "patch " + std::to_string(number);
  if (patch.region < 0 || index(patch.region) >= network.regions.size()) {
    return defect("patch has no region", where, std::to_string(patch.region),
                  "a patch belongs to one region");
  }
  const auto wanted = index(patch.u.control_point_count()) * index(patch.v.control_point_count());
  if (patch.control.size() != wanted) {
    return defect("wrong number of control points", where, std::to_string(patch.control.size()),
                  std::to_string(wanted) + " are needed");
  }

  for (const int c : patch.control) {
    if (c < 0 || c >= network.control_points_mm.cols()) {
      return defect("control point outside the pool", where, std::to_string(c),
                    "0 to " + std::to_string(network.control_points_mm.cols() - 1));
    }
  }

  for (const KnotVector* knots : {&patch.u, &patch.v}) {
    if (knots->knots().front() != knots->first() || knots->knots().back() != knots->last()) {
      return defect("knot vector is not clamped", where, {}, "network patches have clamped ends");
    }
  }
  return std::nullopt;
}

using SideUse = std::vector<std::pair<double, double>>;

// Each side must be covered once, end to end, by the intervals that name it.
std::optional<Error> find_cover_defect(const SurfaceNetwork& network, int number, int side,
                                       SideUse uses) {
  const Patch& patch = network.patches[index(number)];
  const KnotVector& knots = side_knots(patch, static_cast<PatchSide>(side));
  std::sort(uses.begin(), uses.end());
  double reached = knots.first();
  for (const auto& [from, to] : uses) {
    if (from != reached || !(to > from)) break;
    reached = to;
  }

  double covered = 0;
  for (const auto& [from, to] : uses) covered += to - from;
  if (reached == knots.last() && covered <= (knots.last() - knots.first()) * (1 + 1e-12)) {
    return std::nullopt;
  }
  static constexpr std::array<const char*, 4> kNames{"u0", "u1", "v0", "v1"};
  return defect("side is not covered exactly once by joins and rims",
                patch_name(network, number) + ", side " + kNames[index(side)],
                std::to_string(uses.size()) + " uses",
                "every part of a side is in one join or rim");
}

std::optional<Error> find_rim_defect(const SurfaceNetwork& network, const Rim& rim) {
  if (rim.sides.empty()) return defect("rim has no sides", rim.name, {}, "a rim is a closed chain");
  const double tolerance = 1e-9 * rim.radius_mm;
  const auto ends = [&](const Side& s) {
    return std::array<Vec3, 2>{side_point(network, s, s.from), side_point(network, s, s.to)};
  };

  // From either end of the first side on, always by the nearer end of the next one.
  const std::array<Vec3, 2> first = ends(rim.sides.front());
  for (const int start : {0, 1}) {
    Vec3 at = first[index(1 - start)];
    bool chained = true;
    for (std::size_t k = 1; k < rim.sides.size() && chained; ++k) {
      const std::array<Vec3, 2> e = ends(rim.sides[k]);
      const int near = (e[0] - at).norm() <= (e[1] - at).norm() ? 0 : 1;
      chained = (e[index(near)] - at).norm() <= tolerance;
      at = e[index(1 - near)];
    }
    if (chained && (at - first[index(start)]).norm() <= tolerance) return std::nullopt;
  }
  return defect("rim is not a closed chain", rim.name, std::to_string(rim.sides.size()) + " sides",
                "sides follow each other head to tail");
}

std::optional<Error> find_rim_frame_defect(const Rim& rim) {
  if (rim.name.empty()) return defect("rim has no name", "network", {}, "rims are named");
  if (!rim.center_mm.allFinite()) {
    return defect("rim's centre is not finite", rim.name, {}, "coordinates are finite");
  }
  if (!(std::abs(rim.normal.norm() - 1) <= 1e-6)) {
    return defect("rim's normal is not a unit vector", rim.name, std::to_string(rim.normal.norm()),
                  "normals have length 1");
  }
  if (!(rim.radius_mm > 0) || !std::isfinite(rim.radius_mm)) {
    return defect("rim's radius is not positive", rim.name, std::to_string(rim.radius_mm),
                  "radii are positive and finite");
  }
  return std::nullopt;
}

// Every part of every side in exactly one join or rim.
std::optional<Error> find_side_defect(const SurfaceNetwork& network) {
  std::vector<std::array<SideUse, 4>> uses(network.patches.size());
  const auto use = [&](const Side& s) {
    if (s.patch < 0 || index(s.patch) >= uses.size()) return false;
    uses[index(s.patch)][static_cast<std::size_t>(s.side)].emplace_back(s.from, s.to);
    return true;
  };
  for (std::size_t j = 0; j < network.joins.size(); ++j) {
    if (!use(network.joins[j].a) || !use(network.joins[j].b)) {
      return defect("join names a patch that is not there", "join " + std::to_string(j), {}, {});
    }
  }
  for (const Rim& rim : network.rims) {
    for (const Side& side : rim.sides) {
      if (!use(side)) return defect("rim names a patch that is not there", rim.name, {}, {});
    }
  }

  for (std::size_t p = 0; p < uses.size(); ++p) {
    for (int side = 0; side < 4; ++side) {
      if (auto error =
              find_cover_defect(network, static_cast<int>(p), side, uses[p][index(side)])) {
        return error;
      }
    }
  }
  return std::nullopt;
}

std::optional<Error> find_dependency_defect(const SurfaceNetwork& network) {
  const auto count = static_cast<std::size_t>(network.control_points_mm.cols());
  std::vector<char> dependent(count, 0);
  const auto in_pool = [&](int point) { return point >= 0 && index(point) < count; };
  for (std::size_t d = 0; d < network.dependencies.size(); ++d) {
    const int point = network.dependencies[d].point;
    const std::string where = "dependency " + std::to_string(d);
    if (!in_pool(point)) {
      return defect("dependent point outside the pool", where, std::to_string(point), {});
    }
    if (dependent[index(point)] != 0) {
      return defect("point depends twice", where, std::to_string(point), "one dependency a point");
    }
    dependent[index(point)] = 1;
  }

  for (std::size_t d = 0; d < network.dependencies.size(); ++d) {
    for (const auto& [master, weight] : network.dependencies[d].masters) {
      if (!in_pool(master) || dependent[index(master)] != 0 || !std::isfinite(weight)) {
        return defect("master is not a free point with a finite weight",
                      "dependency " + std::to_string(d), std::to_string(master),
                      "masters are never dependent themselves");
      }
    }
  }
  return std::nullopt;
}

}  // namespace

BSplineSurface<3> patch_surface(const SurfaceNetwork& network, int number) {
  const Patch& patch = network.patches[index(number)];
  Points3 points(3, static_cast<Eigen::Index>(patch.control.size()));
  for (std::size_t k = 0; k < patch.control.size(); ++k) {
    points.col(static_cast<Eigen::Index>(k)) = network.control_points_mm.col(patch.control[k]);
  }
  return BSplineSurface<3>(patch.u, patch.v, std::move(points));
}

AppendOffsets append(SurfaceNetwork& network, const SurfaceNetwork& part) {
  const AppendOffsets offset{static_cast<int>(network.control_points_mm.cols()),
                             static_cast<int>(network.patches.size())};
  const int region = static_cast<int>(network.regions.size());
  const auto shifted = [&](Side side) {
    side.patch += offset.patch;
    return side;
  };

  // The pool grows at its end, so that numbers of `network` stay what they are.
  network.control_points_mm.conservativeResize(Eigen::NoChange,
                                               offset.point + part.control_points_mm.cols());
  network.control_points_mm.rightCols(part.control_points_mm.cols()) = part.control_points_mm;
  network.regions.insert(network.regions.end(), part.regions.begin(), part.regions.end());
  for (Patch patch : part.patches) {
    for (int& c : patch.control) c += offset.point;
    patch.region += region;
    network.patches.push_back(std::move(patch));
  }

  for (const Join& join : part.joins) {
    network.joins.push_back({shifted(join.a), shifted(join.b), join.reversed});
  }
  for (Rim rim : part.rims) {
    for (Side& side : rim.sides) side = shifted(side);
    network.rims.push_back(std::move(rim));
  }
  for (Dependency dependency : part.dependencies) {
    dependency.point += offset.point;
    for (auto& [master, weight] : dependency.masters) master += offset.point;
    network.dependencies.push_back(std::move(dependency));
  }
  return offset;
}

void apply_dependencies(SurfaceNetwork& network) {
  for (const Dependency& dependency : network.dependencies) {
    Vec3 sum = Vec3::Zero();
    for (const auto& [master, weight] : dependency.masters) {
      sum += weight * network.control_points_mm.col(master);
    }
    network.control_points_mm.col(dependency.point) = sum;
  }
}

double join_parameter_a(const Join& join, double s) {
  return join.a.from + s * (join.a.to - join.a.from);
}

double join_parameter_b(const Join& join, double s) {
  const double along = join.reversed ? 1 - s : s;
  return join.b.from + along * (join.b.to - join.b.from);
}

Vec2 side_parameters(const Patch& patch, PatchSide side, double t) {
  switch (side) {
    case PatchSide::kU0:
      return {patch.u.first(), t};
    case PatchSide::kU1:
      return {patch.u.last(), t};
    case PatchSide::kV0:
      return {t, patch.v.first()};
    case PatchSide::kV1:
      break;
  }
  return {t, patch.v.last()};
}

std::optional<Error> find_defect(const SurfaceNetwork& network) {
  for (Eigen::Index c = 0; c < network.control_points_mm.cols(); ++c) {
    if (!network.control_points_mm.col(c).allFinite()) {
      return defect("control point is not finite", "control point " + std::to_string(c), {},
                    "coordinates are finite");
    }
  }

  for (const Region& region : network.regions) {
    if (region.name.empty())
      return defect("region has no name", "network", {}, "regions are named");
    if (!(region.radius_mm >= 0) || !std::isfinite(region.radius_mm)) {
      return defect("region's radius is negative or not finite", region.name,
                    std::to_string(region.radius_mm), "radii are finite; 0 is unknown");
    }
  }

  for (std::size_t p = 0; p < network.patches.size(); ++p) {
    if (auto error = find_patch_defect(network, static_cast<int>(p))) return error;
  }
  if (auto error = find_side_defect(network)) return error;

  // Rims are asked last: their chains are followed over sides that are there.
  for (const Rim& rim : network.rims) {
    if (auto error = find_rim_frame_defect(rim)) return error;
    if (auto error = find_rim_defect(network, rim)) return error;
  }
  return find_dependency_defect(network);
}

}  // namespace angiospline
