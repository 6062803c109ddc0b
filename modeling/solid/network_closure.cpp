#include "modeling/solid/network_closure.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "base/index.h"
#include "kernel/evaluate/grid.h"
#include "kernel/numerics/quadrature.h"
#include "modeling/solid/boundary_model.h"
#include "modeling/solid/rules.h"

namespace angiospline {
namespace {

using namespace solid_rules;

double radius_of(const SurfaceNetwork& network, int patch) {
  return network.regions[index(network.patches[index(patch)].region)].radius_mm;
}

Vec3 point_on(const NetworkShape& shape, const Side& side, double t) {
  const Vec2 uv = side_parameters(shape.network.patches[index(side.patch)], side.side, t);
  return shape.surfaces[index(side.patch)].at(uv.x(), uv.y());
}

// The side of the wall that a step around a rim runs along.
const Side& side_of(const NetworkShape& shape, const LoopEdge& step) {
  return shape.topology.edges[index(step.edge)].sides[0];
}

BSplineCurve<3> curve_of(const NetworkShape& shape, const Side& side) {
  return side_curve(shape.surfaces[index(side.patch)], side.side);
}

// What the rim's loop encloses as a vector along the normal that it runs around, by chords.
Vec3 area_vector(const NetworkShape& shape, int number) {
  const Rim& rim = shape.network.rims[index(number)];
  Vec3 area = Vec3::Zero();
  for (const LoopEdge& step : shape.topology.rim_loops[index(number)]) {
    const Side& side = side_of(shape, step);
    const BSplineCurve<3> curve = curve_of(shape, side);
    for (int k = 0; k < kLoopChords; ++k) {
      const Vec3 a = curve.at(side.from + k * (side.to - side.from) / kLoopChords) - rim.center_mm;
      const Vec3 b =
          curve.at(side.from + (k + 1) * (side.to - side.from) / kLoopChords) - rim.center_mm;
      area += (step.forward ? 0.5 : -0.5) * a.cross(b);
    }
  }
  return area;
}

// The control points of a rim's sides, whose hull the rim lies in.
std::vector<Vec3> polygon_of(const NetworkShape& shape, int rim) {
  std::vector<Vec3> points;
  for (const LoopEdge& step : shape.topology.rim_loops[index(rim)]) {
    const BSplineCurve<3> curve = curve_of(shape, side_of(shape, step));
    const Points3& polygon = curve.control_points();
    for (Eigen::Index k = 0; k < polygon.cols(); ++k) points.emplace_back(polygon.col(k));
  }
  return points;
}

// (S - origin) . (Su x Sv) / 3 has degree 3 p - 1 in each direction.
double volume_under(const BSplineSurface<3>& surface, const Vec3& origin) {
  const auto rule = [](const KnotVector& knots) {
    return gauss_legendre(knots.breakpoints(), (3 * knots.degree() + 1) / 2);
  };
  const PiecewiseRule us = rule(surface.u()), vs = rule(surface.v());
  const SurfaceGrid<3> grid = evaluate_grid(surface, us.nodes, vs.nodes, 1);

  double volume = 0;
  Eigen::Index k = 0;
  for (const double wu : us.weights) {
    for (const double wv : vs.weights) {
      const Vec3 su = grid.partial(1, 0).col(k), sv = grid.partial(0, 1).col(k);
      volume += wu * wv * (grid.points().col(k) - origin).dot(su.cross(sv)) / 3;
      ++k;
    }
  }
  return volume;
}

// Half the integral of (C - center) x C', of degree 2 p - 1, along the rim.
double cap_area(const NetworkShape& shape, int rim, const CapPlane& plane) {
  double area = 0;
  for (const LoopEdge& step : shape.topology.rim_loops[index(rim)]) {
    const Side& side = side_of(shape, step);
    const BSplineCurve<3> curve = curve_of(shape, side);
    const PiecewiseRule rule =
        gauss_legendre(breaks_between(curve.knots(), side.from, side.to), curve.knots().degree());
    for (std::size_t k = 0; k < rule.nodes.size(); ++k) {
      const Vec3 arm = curve.at(rule.nodes[k]) - plane.center_mm;
      area += (step.forward ? 0.5 : -0.5) * rule.weights[k] *
              arm.cross(curve.at(rule.nodes[k], 1)).dot(plane.normal);
    }
  }
  return area;
}

}  // namespace

std::string patch_title(const SurfaceNetwork& network, int patch) {
  return "patch " + std::to_string(patch) + " of " +
         network.regions[index(network.patches[index(patch)].region)].name;
}

std::vector<double> join_gaps_mm(const NetworkShape& shape) {
  std::vector<double> gaps_mm(shape.topology.edges.size(), 0.0);
  for (std::size_t e = 0; e < gaps_mm.size(); ++e) {
    const NetworkEdge& edge = shape.topology.edges[e];
    if (!edge.is_join()) continue;
    for (int k = 0; k < kGapSamples; ++k) {
      const double s = k / (kGapSamples - 1.0);
      const double t = edge.sides[0].from + s * (edge.sides[0].to - edge.sides[0].from);
      const double gap = (point_on(shape, edge.sides[0], t) -
                          point_on(shape, edge.sides[1], second_parameter(edge, t)))
                             .norm();
      gaps_mm[e] = std::max(gaps_mm[e], gap);
    }
  }
  return gaps_mm;
}

std::optional<Error> find_open_join(const NetworkShape& shape, const std::vector<double>& gaps_mm) {
  for (std::size_t e = 0; e < gaps_mm.size(); ++e) {
    const NetworkEdge& edge = shape.topology.edges[e];
    if (!edge.is_join()) continue;
    const int a = edge.sides[0].patch, b = edge.sides[1].patch;
    const double radius = std::min(radius_of(shape.network, a), radius_of(shape.network, b));
    if (!(radius > 0) || gaps_mm[e] <= kLargestGap * radius) continue;
    return Error{ErrorKind::kBadInput, "joined sides are not the same curve",
                 patch_title(shape.network, a) + " and " + patch_title(shape.network, b),
                 std::to_string(gaps_mm[e]) + " mm apart", "joins close within 0.001 radii"};
  }
  return std::nullopt;
}

Result<CapPlane> cap_plane(const NetworkShape& shape, int number) {
  const Rim& rim = shape.network.rims[index(number)];
  const std::vector<Vec3> points = polygon_of(shape, number);
  const Vec3 area = area_vector(shape, number);
  const auto distance_to = [&](const Vec3& center, const Vec3& normal) {
    double largest = 0;
    for (const Vec3& p : points) largest = std::max(largest, std::abs((p - center).dot(normal)));
    return largest;
  };

  const double size = std::max(rim.radius_mm, std::sqrt(area.norm()));
  CapPlane plane{rim.center_mm, rim.normal, 0.0};
  if (plane.normal.dot(area) < 0) plane.normal = -plane.normal;
  plane.distance_mm = distance_to(plane.center_mm, plane.normal);

  // A rim that has left its plane, as after a fit: the plane through the mean of its control points
  // across the area it encloses.
  if (!(plane.distance_mm <= kFlatRim * size)) {
    Vec3 mean = Vec3::Zero();
    for (const Vec3& p : points) mean += p / static_cast<double>(points.size());
    plane = {mean, area.normalized(), distance_to(mean, area.normalized())};
  }
  if (!(plane.distance_mm <= kLargestGap * size)) {
    return fail({ErrorKind::kBadInput, "rim is not plane", rim.name,
                 std::to_string(plane.distance_mm) + " mm",
                 "a rim lies within 0.001 radii of a plane"});
  }
  return plane;
}

std::vector<double> signed_volumes_mm3(const NetworkShape& shape,
                                       const std::vector<CapPlane>& planes) {
  const NetworkTopology& topology = shape.topology;
  std::vector<double> volumes(index(topology.component_count), 0.0);
  // About a point of each component, so that as little as possible cancels.
  std::vector<Vec3> origins(volumes.size(), Vec3::Zero());
  for (std::size_t p = shape.surfaces.size(); p-- > 0;) {
    origins[index(topology.components[p])] = shape.surfaces[p].control_points().col(0);
  }

  // By the divergence theorem: a third of the flux of (x - origin) through wall and caps.
  for (std::size_t p = 0; p < shape.surfaces.size(); ++p) {
    const std::size_t c = index(topology.components[p]);
    volumes[c] += volume_under(shape.surfaces[p], origins[c]);
  }
  for (std::size_t r = 0; r < planes.size(); ++r) {
    const Side& side = side_of(shape, topology.rim_loops[r].front());
    const std::size_t c = index(topology.components[index(side.patch)]);
    volumes[c] += cap_area(shape, static_cast<int>(r), planes[r]) *
                  planes[r].normal.dot(planes[r].center_mm - origins[c]) / 3;
  }
  return volumes;
}

}  // namespace angiospline
