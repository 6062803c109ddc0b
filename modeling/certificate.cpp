#include "modeling/certificate.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <tbb/parallel_for.h>

#include "kernel/grid.h"
#include "kernel/quadrature.h"
#include "modeling/boundary_model.h"
#include "modeling/self_intersection.h"
#include "modeling/solid_boundary.h"

namespace angiospline {
namespace {

// A normal shorter than this share of the mean on its face has no usable direction.
constexpr double kDegenerate = 1e-9;

std::size_t index(int i) { return static_cast<std::size_t>(i); }

// What one face contributes.
struct FaceMeasure {
  double area_mm2 = 0.0;
  double volume_mm3 = 0.0;
  Vec3 lowest_mm = Vec3::Constant(std::numeric_limits<double>::infinity());
  Vec3 highest_mm = Vec3::Constant(-std::numeric_limits<double>::infinity());
  double mean_jacobian = 0.0;
  double jacobian_ratio = 1.0;
  double max_curvature = 0.0;
};

// The larger principal curvature in absolute value; nothing where the surface is singular.
std::optional<double> largest_curvature(const SurfaceJet& jet) {
  const Vec3 normal = jet.su.cross(jet.sv);
  const double length = normal.norm();
  if (!(length > 0)) return std::nullopt;
  const Vec3 n = normal / length;
  const double e = jet.su.squaredNorm(), f = jet.su.dot(jet.sv), g = jet.sv.squaredNorm();
  const double l = jet.suu.dot(n), m = jet.suv.dot(n), nn = jet.svv.dot(n);
  const double det = e * g - f * f;
  const double mean = (e * nn - 2 * f * m + g * l) / (2 * det);
  const double gauss = (l * nn - m * m) / det;
  return std::abs(mean) + std::sqrt(std::max(0.0, mean * mean - gauss));
}

// `intervals` equal steps on each knot span, all breakpoints included.
std::vector<double> span_samples(const KnotVector& knots, int intervals) {
  const std::vector<double> breaks = knots.breakpoints();
  std::vector<double> samples{breaks.front()};
  for (std::size_t k = 0; k + 1 < breaks.size(); ++k) {
    for (int i = 1; i < intervals; ++i) {
      samples.push_back(breaks[k] + (breaks[k + 1] - breaks[k]) * i / intervals);
    }
    samples.push_back(breaks[k + 1]);
  }
  return samples;
}

struct QuadraturePoints {
  std::vector<double> nodes;
  std::vector<double> weights;
};

QuadraturePoints span_quadrature(const KnotVector& knots, double from, double to, int count) {
  const GaussRule rule = gauss_legendre(count);
  QuadraturePoints points;
  std::vector<double> breaks{from};
  for (const double b : knots.breakpoints()) {
    if (b > from && b < to) breaks.push_back(b);
  }
  breaks.push_back(to);
  for (std::size_t k = 0; k + 1 < breaks.size(); ++k) {
    const double half = (breaks[k + 1] - breaks[k]) / 2;
    const double mid = (breaks[k + 1] + breaks[k]) / 2;
    for (Eigen::Index i = 0; i < rule.nodes.size(); ++i) {
      points.nodes.push_back(mid + half * rule.nodes(i));
      points.weights.push_back(half * rule.weights(i));
    }
  }
  return points;
}

// The volume under a polynomial patch, S . (Su x Sv) / 3, has degree 3p - 1 in each direction, so
// that Gauss's rule of (3p + 1) / 2 points is exact; areas converge with it.
int gauss_points(int degree) { return (3 * degree + 1) / 2; }

// Where a patch is largest in a direction: the best grid point, then steps that are halved.
Vec3 refine_extreme(const BSplineSurface<3>& patch, double u, double v, double step_u,
                    double step_v, const Vec3& direction) {
  Vec3 best = patch.at(u, v);
  for (int round = 0; round < 26; ++round) {
    const double u0 = u, v0 = v;
    for (int k = 0; k < 9; ++k) {
      const double uk = std::clamp(u0 + (k % 3 - 1) * step_u, patch.u().first(), patch.u().last());
      const double vk = std::clamp(v0 + (k / 3 - 1) * step_v, patch.v().first(), patch.v().last());
      const Vec3 p = patch.at(uk, vk);
      if (p.dot(direction) > best.dot(direction)) {
        best = p;
        u = uk;
        v = vk;
      }
    }
    if (u == u0 && v == v0) {
      step_u /= 2;
      step_v /= 2;
    }
  }
  return best;
}

FaceMeasure measure_patch(const BoundaryFace& face, int intervals) {
  const BSplineSurface<3>& patch = *face.patch;
  FaceMeasure result;
  const QuadraturePoints qu = span_quadrature(patch.u(), patch.u().first(), patch.u().last(),
                                              gauss_points(patch.u().degree()));
  const QuadraturePoints qv = span_quadrature(patch.v(), patch.v().first(), patch.v().last(),
                                              gauss_points(patch.v().degree()));
  const SurfaceGrid<3> inner = evaluate_grid(patch, qu.nodes, qv.nodes, 1);
  for (std::size_t i = 0; i < qu.nodes.size(); ++i) {
    for (std::size_t j = 0; j < qv.nodes.size(); ++j) {
      const auto k = static_cast<Eigen::Index>(i * qv.nodes.size() + j);
      const Vec3 normal = inner.partial(1, 0).col(k).cross(inner.partial(0, 1).col(k));
      const double weight = qu.weights[i] * qv.weights[j];
      result.area_mm2 += weight * normal.norm();
      result.volume_mm3 += weight * inner.points().col(k).dot(normal) / 3;
    }
  }
  if (face.reversed) result.volume_mm3 = -result.volume_mm3;
  result.mean_jacobian = result.area_mm2 / ((patch.u().last() - patch.u().first()) *
                                            (patch.v().last() - patch.v().first()));

  const std::vector<double> us = span_samples(patch.u(), intervals);
  const std::vector<double> vs = span_samples(patch.v(), intervals);
  const SurfaceGrid<3> grid = evaluate_grid(patch, us, vs, 2);
  double least = std::numeric_limits<double>::infinity();
  for (Eigen::Index k = 0; k < grid.points().cols(); ++k) {
    const SurfaceJet jet{grid.points().col(k),      grid.partial(1, 0).col(k),
                         grid.partial(0, 1).col(k), grid.partial(2, 0).col(k),
                         grid.partial(1, 1).col(k), grid.partial(0, 2).col(k)};
    least = std::min(least, jet.su.cross(jet.sv).norm());
    result.max_curvature = std::max(result.max_curvature, largest_curvature(jet).value_or(0.0));
    result.lowest_mm = result.lowest_mm.cwiseMin(jet.s);
    result.highest_mm = result.highest_mm.cwiseMax(jet.s);
  }
  result.jacobian_ratio = result.mean_jacobian > 0 ? least / result.mean_jacobian : 0.0;
  return result;
}

FaceMeasure measure_other(const BoundaryFace& face) {
  FaceMeasure result;
  result.area_mm2 = face.area_mm2.value_or(0.0);
  result.volume_mm3 = face.volume_mm3.value_or(0.0);
  if (face.bounding_box) {
    result.lowest_mm = face.bounding_box->first;
    result.highest_mm = face.bounding_box->second;
  }
  if (face.plane) return result;  // a plane neither folds nor bends
  double sum = 0.0, least = std::numeric_limits<double>::infinity();
  for (const Vec2& uv : face.mesh.parameters) {
    const SurfaceJet jet = face.jet(uv.x(), uv.y());
    const double jacobian = jet.su.cross(jet.sv).norm();
    sum += jacobian;
    least = std::min(least, jacobian);
    result.max_curvature = std::max(result.max_curvature, largest_curvature(jet).value_or(0.0));
  }
  if (face.mesh.parameters.empty()) return result;
  result.mean_jacobian = sum / static_cast<double>(face.mesh.parameters.size());
  result.jacobian_ratio = result.mean_jacobian > 0 ? least / result.mean_jacobian : 0.0;
  return result;
}

// A plane face has the area that its edges enclose; its cone's volume follows.
void add_plane_share(const BoundaryModel& model, const BoundaryEdge& edge, const EdgeUse& use,
                     FaceMeasure& measure) {
  const BoundaryFace& face = model.faces[index(use.face)];
  const auto& [center, normal] = *face.plane;
  const QuadraturePoints q =
      span_quadrature(edge.curve->knots(), edge.from, edge.to, edge.curve->knots().degree() + 1);
  double area = 0.0;
  for (std::size_t k = 0; k < q.nodes.size(); ++k) {
    const Vec3 p = edge.curve->at(q.nodes[k]) - center;
    area += 0.5 * q.weights[k] * p.cross(edge.curve->at(q.nodes[k], 1)).dot(normal);
    measure.lowest_mm = measure.lowest_mm.cwiseMin(p + center);
    measure.highest_mm = measure.highest_mm.cwiseMax(p + center);
  }
  if (!use.forward) area = -area;
  measure.area_mm2 += area;
  measure.volume_mm3 += area * center.dot(normal) / 3;
}

std::vector<double> edge_samples(const BoundaryEdge& edge, int intervals) {
  if (!edge.curve) return spaced(edge.from, edge.to, 4 * intervals + 1);
  std::vector<double> samples{edge.from};
  for (const double t : span_samples(edge.curve->knots(), intervals)) {
    if (t > edge.from && t < edge.to) samples.push_back(t);
  }
  samples.push_back(edge.to);
  return samples;
}

// Points and outward unit normals of one face along an edge.
struct EdgeLine {
  Points3 points;
  Points3 normals;  // zero where the face has none
};

// Inward a little, where a corner is singular: the limit of the normal from inside the face.
Vec3 normal_inside(const BSplineSurface<3>& patch, const Vec2& uv, double least) {
  const Vec2 center(0.5 * (patch.u().first() + patch.u().last()),
                    0.5 * (patch.v().first() + patch.v().last()));
  for (const double share : {1e-6, 1e-4, 1e-2}) {
    const Vec2 at = uv + share * (center - uv);
    const Vec3 normal = normal_vector(patch, at.x(), at.y());
    if (normal.norm() > least) return normal.normalized();
  }
  return Vec3::Zero();
}

EdgeLine line_on_patch(const BoundaryFace& face, const BoundaryEdge& edge, const EdgeUse& use,
                       const std::vector<double>& ts, double least) {
  const BSplineSurface<3>& patch = *face.patch;
  std::vector<double> along;
  for (const double t : ts) {
    const double s = (t - edge.from) / (edge.to - edge.from);
    along.push_back(use.side_from + s * (use.side_to - use.side_from));
  }
  const Vec2 start = side_parameters(patch, use.side, along.front());
  const bool along_v = use.side == PatchSide::kU0 || use.side == PatchSide::kU1;
  const SurfaceGrid<3> grid = along_v
                                  ? evaluate_grid(patch, std::vector<double>{start.x()}, along, 1)
                                  : evaluate_grid(patch, along, std::vector<double>{start.y()}, 1);
  EdgeLine line{grid.points(), Points3(3, grid.points().cols())};
  for (Eigen::Index k = 0; k < line.points.cols(); ++k) {
    const Vec3 normal = grid.partial(1, 0).col(k).cross(grid.partial(0, 1).col(k));
    const double length = normal.norm();
    line.normals.col(k) =
        length > least
            ? Vec3(normal / length)
            : normal_inside(patch,
                            side_parameters(patch, use.side, along[static_cast<std::size_t>(k)]),
                            least);
  }
  if (face.reversed) line.normals = -line.normals;
  return line;
}

EdgeLine line_on(const BoundaryFace& face, const BoundaryEdge& edge, const EdgeUse& use,
                 const std::vector<double>& ts, double least) {
  if (face.is_whole) return line_on_patch(face, edge, use, ts, least);
  const auto count = static_cast<Eigen::Index>(ts.size());
  EdgeLine line{Points3(3, count), Points3::Zero(3, count)};
  for (Eigen::Index k = 0; k < count; ++k) {
    const double t = ts[static_cast<std::size_t>(k)];
    if (face.plane) {
      const auto& [center, normal] = *face.plane;
      const Vec3 p = edge.curve ? Vec3(edge.curve->at(t)) : edge.point(t);
      line.points.col(k) = p - (p - center).dot(normal) * normal;
      line.normals.col(k) = normal;
    } else if (use.parameters) {
      const Vec2 uv = use.parameters(t);
      const SurfaceJet jet = face.jet(uv.x(), uv.y());
      const Vec3 normal = jet.su.cross(jet.sv);
      line.points.col(k) = jet.s;
      if (normal.norm() > least) line.normals.col(k) = normal.normalized();
      if (face.reversed) line.normals.col(k) = -line.normals.col(k);
    } else {
      line.points.col(k) = edge.curve ? Vec3(edge.curve->at(t)) : edge.point(t);
    }
  }
  return line;
}

double angle_between(const Vec3& a, const Vec3& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / std::numbers::pi;
}

struct EdgeMeasure {
  double gap_mm = 0.0;
  double angle_deg = -1.0;  // -1: not a smooth edge
  Vec3 worst_mm = Vec3::Zero();
  int samples = 0;
};

bool is_shared(const BoundaryEdge& edge) { return !edge.is_degenerate && edge.uses.size() == 2; }

bool is_smooth(const BoundaryModel& model, const BoundaryEdge& edge) {
  return is_shared(edge) && model.faces[index(edge.uses[0].face)].kind == FaceKind::kWall &&
         model.faces[index(edge.uses[1].face)].kind == FaceKind::kWall;
}

EdgeMeasure measure_edge(const BoundaryModel& model, const BoundaryEdge& edge,
                         const std::vector<FaceMeasure>& faces, int intervals) {
  EdgeMeasure result;
  if (!is_shared(edge)) return result;
  const std::vector<double> ts = edge_samples(edge, intervals);
  const auto line = [&](const EdgeUse& use) {
    const double least = kDegenerate * faces[index(use.face)].mean_jacobian;
    return line_on(model.faces[index(use.face)], edge, use, ts, least);
  };
  const EdgeLine a = line(edge.uses[0]);
  const EdgeLine b = line(edge.uses[1]);
  result.samples = static_cast<int>(ts.size());
  result.gap_mm = (a.points - b.points).colwise().norm().maxCoeff();
  if (!is_smooth(model, edge)) return result;
  result.angle_deg = 0.0;
  result.worst_mm = a.points.col(0);
  for (Eigen::Index k = 0; k < a.points.cols(); ++k) {
    if (a.normals.col(k).isZero(0) || b.normals.col(k).isZero(0)) continue;
    const double angle = angle_between(a.normals.col(k), b.normals.col(k));
    if (angle > result.angle_deg) {
      result.angle_deg = angle;
      result.worst_mm = a.points.col(k);
    }
  }
  return result;
}

// The figures that follow from topology alone. Handles are counted by the Euler characteristic of
// the closed shells: a face with w loops around it is a disc with w - 1 holes.
void measure_topology(const BoundaryModel& model, Certificate& certificate) {
  int characteristic = 0;
  std::vector<bool> used(index(model.vertex_count), false);
  certificate.closed = model.shells > 0;
  for (const BoundaryEdge& edge : model.edges) {
    for (const int v : {edge.first_vertex, edge.last_vertex}) {
      if (v >= 0 && !edge.uses.empty()) used[index(v)] = true;
    }
    if (edge.is_degenerate || edge.uses.empty()) continue;
    --characteristic;
    if (edge.uses.size() == 1) ++certificate.free_edges;
    if (edge.uses.size() != 2 || edge.uses[0].forward == edge.uses[1].forward) {
      certificate.closed = false;
    }
    if (is_smooth(model, edge)) ++certificate.smooth_edges;
  }
  characteristic += static_cast<int>(std::count(used.begin(), used.end(), true));
  for (const BoundaryFace& face : model.faces) {
    characteristic += 2 - face.loops;
    if (face.shell < 0) certificate.closed = false;
  }
  certificate.solids = model.solids;
  if (certificate.closed) certificate.genus = model.shells - characteristic / 2;
}

// The grid's box, with the patches that reach nearest to each of its sides searched further.
void tighten_box(const BoundaryModel& model, const std::vector<FaceMeasure>& faces, int intervals,
                 Certificate& certificate) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      Vec3 direction = Vec3::Zero();
      direction(axis) = sign;
      double& bound = sign < 0 ? certificate.lowest_mm(axis) : certificate.highest_mm(axis);
      const double from_grid = bound;
      for (std::size_t f = 0; f < faces.size(); ++f) {
        const BoundaryFace& face = model.faces[f];
        if (!face.patch) continue;
        const double reach = sign < 0 ? faces[f].lowest_mm(axis) : faces[f].highest_mm(axis);
        // A grid misses an extreme by far less than this.
        const double slack = 0.02 * (faces[f].highest_mm - faces[f].lowest_mm).norm();
        if (sign * (from_grid - reach) > slack) continue;
        const std::vector<double> us = span_samples(face.patch->u(), intervals);
        const std::vector<double> vs = span_samples(face.patch->v(), intervals);
        const SurfaceGrid<3> grid = evaluate_grid(*face.patch, us, vs, 0);
        Eigen::Index best = 0;
        (sign * grid.points().row(axis)).maxCoeff(&best);
        const auto i = static_cast<std::size_t>(best) / vs.size();
        const auto j = static_cast<std::size_t>(best) % vs.size();
        const double step_u = i + 1 < us.size() ? us[i + 1] - us[i] : us[i] - us[i - 1];
        const double step_v = j + 1 < vs.size() ? vs[j + 1] - vs[j] : vs[j] - vs[j - 1];
        const Vec3 p = refine_extreme(*face.patch, us[i], vs[j], step_u, step_v, direction);
        if (sign * (p(axis) - bound) > 0) bound = p(axis);
      }
    }
  }
}

void gather_faces(const BoundaryModel& model, const std::vector<FaceMeasure>& faces,
                  Certificate& certificate) {
  certificate.lowest_mm.setConstant(std::numeric_limits<double>::infinity());
  certificate.highest_mm = -certificate.lowest_mm;
  certificate.min_jacobian_ratio = 1.0;
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const BoundaryFace& face = model.faces[f];
    const FaceMeasure& m = faces[f];
    certificate.faces.push_back({face.name, face.kind, m.area_mm2});
    certificate.area_mm2 += m.area_mm2;
    certificate.lowest_mm = certificate.lowest_mm.cwiseMin(m.lowest_mm);
    certificate.highest_mm = certificate.highest_mm.cwiseMax(m.highest_mm);
    if (face.kind != FaceKind::kWall) continue;
    if (m.jacobian_ratio < certificate.min_jacobian_ratio ||
        certificate.min_jacobian_face.empty()) {
      certificate.min_jacobian_ratio = std::min(certificate.min_jacobian_ratio, m.jacobian_ratio);
      certificate.min_jacobian_face = face.name;
    }
    if (face.radius_mm > 0) {
      const double product = m.max_curvature * face.radius_mm;
      if (product > certificate.max_curvature_times_radius.value_or(-1.0)) {
        certificate.max_curvature_times_radius = product;
        certificate.max_curvature_face = face.name;
      }
    }
  }
}

// The solids' volumes; each must be positive.
bool gather_volumes(const BoundaryModel& model, const std::vector<FaceMeasure>& faces,
                    Certificate& certificate) {
  std::vector<double> volumes(index(model.solids), 0.0);
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const int shell = model.faces[f].shell;
    const int solid = shell < 0 ? -1 : model.shell_solids[index(shell)];
    if (solid >= 0) volumes[index(solid)] += faces[f].volume_mm3;
  }
  for (const double v : volumes) certificate.volume_mm3 += v;
  return std::all_of(volumes.begin(), volumes.end(), [](double v) { return v > 0; });
}

void gather_edges(const BoundaryModel& model, const std::vector<EdgeMeasure>& edges,
                  Certificate& certificate) {
  double worst = -1.0;
  for (std::size_t e = 0; e < edges.size(); ++e) {
    certificate.max_gap_mm = std::max(certificate.max_gap_mm, edges[e].gap_mm);
    certificate.edge_samples += edges[e].samples;
    if (edges[e].angle_deg <= worst) continue;
    worst = edges[e].angle_deg;
    certificate.max_normal_angle_deg = worst;
    certificate.worst_point_mm = edges[e].worst_mm;
    for (const std::size_t k : {0U, 1U}) {
      certificate.worst_edge[k] = model.faces[index(model.edges[e].uses[k].face)].name;
    }
  }
}

Result<Certificate> measure(const BoundaryModel& model, const CertificateOptions& options,
                            const Progress& progress) {
  Certificate certificate;
  certificate.warnings = model.warnings;
  measure_topology(model, certificate);

  progress.at("measure faces", 0.0);
  std::vector<FaceMeasure> faces(model.faces.size());
  tbb::parallel_for(std::size_t{0}, faces.size(), [&](std::size_t f) {
    if (progress.should_stop()) return;
    const BoundaryFace& face = model.faces[f];
    faces[f] = face.is_whole ? measure_patch(face, options.samples_per_span) : measure_other(face);
  });
  if (progress.should_stop()) return fail(cancelled("measure faces"));
  for (const BoundaryEdge& edge : model.edges) {
    for (const EdgeUse& use : edge.uses) {
      const BoundaryFace& face = model.faces[index(use.face)];
      if (face.plane && !face.area_mm2) {
        add_plane_share(model, edge, use, faces[index(use.face)]);
      }
    }
  }

  progress.at("measure edges", 0.3);
  std::vector<EdgeMeasure> edges(model.edges.size());
  tbb::parallel_for(std::size_t{0}, edges.size(), [&](std::size_t e) {
    if (progress.should_stop()) return;
    edges[e] = measure_edge(model, model.edges[e], faces, options.samples_per_span);
  });
  if (progress.should_stop()) return fail(cancelled("measure edges"));

  gather_faces(model, faces, certificate);
  gather_edges(model, edges, certificate);
  tighten_box(model, faces, options.samples_per_span, certificate);
  const bool positive = gather_volumes(model, faces, certificate);
  certificate.valid = model.is_sound && model.solids > 0 && certificate.closed && positive;

  if (options.find_self_intersections) {
    Result<SelfIntersection> found =
        find_self_intersection(model, options.most_triangles, progress);
    if (!found) return fail(found.error());
    certificate.self_intersecting = found->found;
    certificate.self_intersection = found->faces;
    certificate.self_intersection_mm = found->place_mm;
    certificate.self_intersection_resolution_mm = found->resolution_mm;
  }
  progress.at("measure", 1.0);
  return certificate;
}

}  // namespace

Result<Certificate> certify(const Solid& solid, const CertificateOptions& options,
                            const Progress& progress) {
  const Result<BoundaryModel> model = boundary_of(solid, progress);
  if (!model) return fail(model.error());
  return measure(*model, options, progress);
}

Result<Certificate> certify(const SurfaceNetwork& network, const CertificateOptions& options,
                            const Progress& progress) {
  const Result<BoundaryModel> model = boundary_of(network);
  if (!model) return fail(model.error());
  return measure(*model, options, progress);
}

}  // namespace angiospline
