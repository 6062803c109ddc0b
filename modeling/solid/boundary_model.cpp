#include "modeling/solid/boundary_model.h"

#include "base/index.h"
#include "modeling/network/network_topology.h"
#include "modeling/solid/rules.h"

namespace angiospline {
namespace {

EdgeUse use_of(const NetworkEdge& edge, int use) {
  EdgeUse result;
  const Side& side = edge.sides[index(use)];
  result.face = side.patch;
  result.on_side = true;
  result.side = side.side;
  result.side_from = side.from;
  result.side_to = side.to;
  if (use == 1 && edge.reversed) std::swap(result.side_from, result.side_to);
  return result;
}

BoundaryEdge edge_of(const BoundaryModel& model, const NetworkEdge& edge) {
  BoundaryEdge result;
  result.from = edge.sides[0].from;
  result.to = edge.sides[0].to;
  result.first_vertex = edge.first_vertex;
  result.last_vertex = edge.last_vertex;
  BSplineCurve<3> curve =
      side_curve(*model.faces[index(edge.sides[0].patch)].patch, edge.sides[0].side);
  result.breaks = breaks_between(curve.knots(), result.from, result.to);
  result.point = edge_points(std::move(curve));
  result.uses.push_back(use_of(edge, 0));
  if (edge.is_join()) result.uses.push_back(use_of(edge, 1));
  return result;
}

// A cap's plane: its rim's centre, and the normal that its loop runs around.
std::pair<Vec3, Vec3> plane_of(const Rim& rim, const std::vector<LoopEdge>& loop,
                               const std::vector<BoundaryEdge>& edges) {
  Vec3 area = Vec3::Zero();
  for (const LoopEdge& step : loop) {
    const BoundaryEdge& edge = edges[index(step.edge)];
    for (int k = 0; k < solid_rules::kLoopChords; ++k) {
      const double h = (edge.to - edge.from) / solid_rules::kLoopChords;
      const Vec3 a = edge.point(edge.from + k * h).at - rim.center_mm;
      const Vec3 b = edge.point(edge.from + (k + 1) * h).at - rim.center_mm;
      area += (step.forward ? 0.5 : -0.5) * a.cross(b);
    }
  }
  return {rim.center_mm, rim.normal.dot(area) < 0 ? Vec3(-rim.normal) : rim.normal};
}

}  // namespace

Vec2 side_parameters(const BSplineSurface<3>& patch, PatchSide side, double t) {
  switch (side) {
    case PatchSide::kU0:
      return {patch.u().first(), t};
    case PatchSide::kU1:
      return {patch.u().last(), t};
    case PatchSide::kV0:
      return {t, patch.v().first()};
    case PatchSide::kV1:
      break;
  }
  return {t, patch.v().last()};
}

BSplineCurve<3> side_curve(const BSplineSurface<3>& patch, PatchSide side) {
  const bool along_v = side == PatchSide::kU0 || side == PatchSide::kU1;
  const KnotVector& knots = along_v ? patch.v() : patch.u();
  const int row = side == PatchSide::kU1   ? patch.u_count() - 1
                  : side == PatchSide::kV1 ? patch.v_count() - 1
                                           : 0;
  Points3 points(3, knots.control_point_count());
  for (int k = 0; k < knots.control_point_count(); ++k) {
    points.col(k) = along_v ? patch.control_point(row, k) : patch.control_point(k, row);
  }
  return BSplineCurve<3>(knots, std::move(points));
}

std::function<EdgePoint<Vec3>(double)> edge_points(BSplineCurve<3> curve) {
  const auto shared = std::make_shared<const BSplineCurve<3>>(std::move(curve));
  return [shared](double t) {
    const BasisValues b = basis_at(shared->knots(), t, 1);
    const auto points = shared->control_points().middleCols(b.first, shared->knots().order());
    return EdgePoint<Vec3>{points * b.values.row(0).transpose(),
                           points * b.values.row(1).transpose()};
  };
}

std::vector<double> breaks_between(const KnotVector& knots, double from, double to) {
  std::vector<double> breaks{from};
  for (const double b : knots.breakpoints()) {
    if (b > from && b < to) breaks.push_back(b);
  }
  breaks.push_back(to);
  return breaks;
}

Result<BoundaryModel> boundary_of(const SurfaceNetwork& network) {
  Result<NetworkTopology> made = network_topology(network);
  if (!made) return fail(made.error());
  const NetworkTopology& topology = *made;
  BoundaryModel model;
  model.vertex_count = static_cast<int>(topology.vertices_mm.cols());
  model.solids = model.shells = topology.component_count;
  for (int c = 0; c < topology.component_count; ++c) model.shell_solids.push_back(c);

  // A face for each patch, whole, its edges along its sides.
  for (std::size_t p = 0; p < network.patches.size(); ++p) {
    const Region& region = network.regions[index(network.patches[p].region)];
    BoundaryFace face;
    face.name = region.name;
    face.radius_mm = region.radius_mm;
    face.shell = topology.components[p];
    face.patch = std::make_shared<BSplineSurface<3>>(patch_surface(network, static_cast<int>(p)));
    face.is_whole = true;
    model.faces.push_back(std::move(face));
  }
  for (const NetworkEdge& edge : topology.edges) model.edges.push_back(edge_of(model, edge));
  for (const std::vector<LoopEdge>& loop : topology.patch_loops) {
    for (const LoopEdge& step : loop) {
      model.edges[index(step.edge)].uses[index(step.use)].forward = step.forward;
    }
  }

  // A plane face for each rim.
  for (std::size_t r = 0; r < network.rims.size(); ++r) {
    const Rim& rim = network.rims[r];
    BoundaryFace face;
    face.name = rim.name;
    face.kind = kind_of_rim(rim.kind);
    face.radius_mm = rim.radius_mm;
    face.shell = topology.components[index(rim.sides.front().patch)];
    face.plane = plane_of(rim, topology.rim_loops[r], model.edges);
    for (const LoopEdge& step : topology.rim_loops[r]) {
      EdgeUse use;
      use.face = static_cast<int>(model.faces.size());
      use.forward = step.forward;
      model.edges[index(step.edge)].uses.push_back(use);
    }
    model.faces.push_back(std::move(face));
  }
  return model;
}

}  // namespace angiospline
