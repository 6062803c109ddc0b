#include "modeling/check/face_measure.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <tbb/parallel_for.h>

#include "base/index.h"
#include "kernel/evaluate/grid.h"
#include "kernel/numerics/quadrature.h"
#include "modeling/check/rules.h"

namespace angiospline {
namespace {

using namespace check_rules;

// The larger principal curvature in absolute value; nothing where the surface is singular.
std::optional<double> largest_curvature(const SurfaceJet& jet) {
  const Vec3 normal = jet.u.cross(jet.v);
  const double length = normal.norm();
  if (!(length > 0)) return std::nullopt;

  // First and second fundamental form; mean and Gaussian curvature (do Carmo 1976, 3-3).
  const Vec3 n = normal / length;
  const double e = jet.u.squaredNorm(), f = jet.u.dot(jet.v), g = jet.v.squaredNorm();
  const double l = jet.uu.dot(n), m = jet.uv.dot(n), nn = jet.vv.dot(n);
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

// The volume under a polynomial patch, S . (Su x Sv) / 3, has degree 3p - 1 in each direction, so
// that Gauss's rule of (3p + 1) / 2 points is exact; areas converge with it.
int gauss_points(int degree) { return (3 * degree + 1) / 2; }

// Where a patch is largest in a direction: the best grid point, then steps that are halved.
Vec3 refine_extreme(const BSplineSurface<3>& patch, double u, double v, double step_u,
                    double step_v, const Vec3& direction) {
  Vec3 best = patch.at(u, v);
  for (int round = 0; round < kExtremeRounds; ++round) {
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
  const PiecewiseRule qu =
      gauss_legendre(patch.u().breakpoints(), gauss_points(patch.u().degree()));
  const PiecewiseRule qv =
      gauss_legendre(patch.v().breakpoints(), gauss_points(patch.v().degree()));

  // Area and volume by Gauss's rule.
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

  // What is extreme somewhere, at samples: |Su x Sv|, curvature, the box.
  const std::vector<double> us = span_samples(patch.u(), intervals);
  const std::vector<double> vs = span_samples(patch.v(), intervals);
  const SurfaceGrid<3> grid = evaluate_grid(patch, us, vs, 2);
  double least = std::numeric_limits<double>::infinity();
  for (Eigen::Index k = 0; k < grid.points().cols(); ++k) {
    const SurfaceJet jet{grid.points().col(k),      grid.partial(1, 0).col(k),
                         grid.partial(0, 1).col(k), grid.partial(2, 0).col(k),
                         grid.partial(1, 1).col(k), grid.partial(0, 2).col(k)};
    least = std::min(least, jet.u.cross(jet.v).norm());
    result.max_curvature = std::max(result.max_curvature, largest_curvature(jet).value_or(0.0));
    result.lowest_mm = result.lowest_mm.cwiseMin(jet.point);
    result.highest_mm = result.highest_mm.cwiseMax(jet.point);
  }
  result.jacobian_ratio = result.mean_jacobian > 0 ? least / result.mean_jacobian : 0.0;
  return result;
}

FaceMeasure measure_other(const BoundaryFace& face) {
  FaceMeasure result;
  if (face.bounding_box) {
    result.lowest_mm = face.bounding_box->first;
    result.highest_mm = face.bounding_box->second;
  }
  if (face.plane) return result;  // a plane neither folds nor bends

  double sum = 0.0, least = std::numeric_limits<double>::infinity();
  for (const Vec2& uv : face.mesh.parameters) {
    const SurfaceJet jet = face.jet(uv.x(), uv.y());
    const double jacobian = jet.u.cross(jet.v).norm();
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
void add_plane_share(const BoundaryFace& face, const BoundaryEdge& edge, const EdgeUse& use,
                     FaceMeasure& measure) {
  const auto& [center, normal] = *face.plane;
  const PiecewiseRule q = gauss_legendre(edge.breaks, kEdgeGaussPoints);
  double area = 0.0;
  for (std::size_t k = 0; k < q.nodes.size(); ++k) {
    const EdgePoint<Vec3> p = edge.point(q.nodes[k]);
    area += 0.5 * q.weights[k] * (p.at - center).cross(p.derivative).dot(normal);
  }
  if (!use.forward) area = -area;
  measure.area_mm2 += area;
  measure.volume_mm3 += area * center.dot(normal) / 3;
}

// The box of a piece of an edge: its samples, and around the extreme ones steps that are halved.
void add_edge_box(const BoundaryEdge& edge, FaceMeasure& measure) {
  std::vector<double> ts{edge.from};
  for (std::size_t k = 0; k + 1 < edge.breaks.size(); ++k) {
    for (int i = 1; i <= kBoxSteps; ++i) {
      ts.push_back(edge.breaks[k] + (edge.breaks[k + 1] - edge.breaks[k]) * i / kBoxSteps);
    }
  }

  // Towards each of the box's six sides.
  for (int direction = 0; direction < 6; ++direction) {
    const int axis = direction / 2;
    const double sign = direction % 2 == 0 ? 1.0 : -1.0;
    const auto reach = [&](double t) { return sign * edge.point(t).at(axis); };
    double best = ts.front(), highest = reach(best);
    const auto try_at = [&](double t) {
      if (const double r = reach(t); r > highest) {
        highest = r;
        best = t;
      }
    };
    for (const double t : ts) try_at(t);

    double step = (edge.to - edge.from) / static_cast<double>(ts.size() - 1);
    for (int round = 0; round < kExtremeRounds; ++round, step /= 2) {
      const double at = best;
      try_at(std::min(at + step, edge.to));
      try_at(std::max(at - step, edge.from));
    }
    const Vec3 p = edge.point(best).at;
    measure.lowest_mm = measure.lowest_mm.cwiseMin(p);
    measure.highest_mm = measure.highest_mm.cwiseMax(p);
  }
}

// Area and volume between the line u = u_reference and a point of the boundary, along u.
Vec2 strip_to(const BoundaryFace& face, const Vec2& uv) {
  std::vector<double> breaks{face.u_reference};
  const double last = uv.x();
  if (last >= face.u_reference) {
    for (const double b : face.u_breaks) {
      if (b > face.u_reference && b < last) breaks.push_back(b);
    }
  }
  breaks.push_back(last);

  const PiecewiseRule q = gauss_legendre(breaks, kEdgeGaussPoints);
  Vec2 sum = Vec2::Zero();
  for (std::size_t k = 0; k < q.nodes.size(); ++k) {
    const SurfaceJet jet = face.jet(q.nodes[k], uv.y());
    const Vec3 normal = jet.u.cross(jet.v);
    sum += q.weights[k] * Vec2(normal.norm(), jet.point.dot(normal) / 3);
  }
  return sum;
}

// Green's theorem in the parameters of a trimmed face: the integral of f over it is the integral of
// (the integral of f along u) dv around it, counter-clockwise.
void add_trimmed_share(const BoundaryFace& face, const BoundaryEdge& edge, const EdgeUse& use,
                       FaceMeasure& measure) {
  if (!use.parameters) return;
  const PiecewiseRule q = gauss_legendre(edge.breaks, kEdgeGaussPoints);
  Vec2 sum = Vec2::Zero();
  for (std::size_t k = 0; k < q.nodes.size(); ++k) {
    const EdgePoint<Vec2> p = use.parameters(q.nodes[k]);
    if (p.derivative.y() != 0) sum += q.weights[k] * p.derivative.y() * strip_to(face, p.at);
  }
  const bool with_parameters = use.forward != face.reversed;
  measure.area_mm2 += with_parameters ? sum(0) : -sum(0);
  measure.volume_mm3 += use.forward ? sum(1) : -sum(1);
}

// The edges of each face, as pairs of edge and use.
std::vector<std::vector<std::pair<int, int>>> uses_of_faces(const BoundaryModel& model) {
  std::vector<std::vector<std::pair<int, int>>> uses(model.faces.size());
  for (std::size_t e = 0; e < model.edges.size(); ++e) {
    for (std::size_t k = 0; k < model.edges[e].uses.size(); ++k) {
      uses[index(model.edges[e].uses[k].face)].emplace_back(static_cast<int>(e),
                                                            static_cast<int>(k));
    }
  }
  return uses;
}

}  // namespace

std::vector<FaceMeasure> measure_faces(const BoundaryModel& model, int intervals,
                                       const Progress& progress) {
  const auto uses = uses_of_faces(model);
  std::vector<FaceMeasure> measures(model.faces.size());
  tbb::parallel_for(std::size_t{0}, measures.size(), [&](std::size_t f) {
    if (progress.should_stop()) return;
    const BoundaryFace& face = model.faces[f];
    measures[f] = face.is_whole ? measure_patch(face, intervals) : measure_other(face);
    if (face.is_whole) return;

    // Other faces get their area and volume from the edges around them.
    for (const auto& [e, k] : uses[f]) {
      const BoundaryEdge& edge = model.edges[index(e)];
      const EdgeUse& use = edge.uses[index(k)];
      if (!face.plane) {
        add_trimmed_share(face, edge, use, measures[f]);
      } else if (edge.point) {
        add_plane_share(face, edge, use, measures[f]);
        // A plane region reaches no farther than its edges; those of patches are boxed with these.
        const bool has_patch = std::any_of(
            edge.uses.begin(), edge.uses.end(),
            [&](const EdgeUse& other) { return model.faces[index(other.face)].is_whole; });
        if (!has_patch) add_edge_box(edge, measures[f]);
      }
    }
  });
  return measures;
}

namespace {

// The point of a patch that reaches farthest in a direction, from its best grid point on.
Vec3 extreme_of(const BSplineSurface<3>& patch, int axis, double sign, int intervals) {
  const std::vector<double> us = span_samples(patch.u(), intervals);
  const std::vector<double> vs = span_samples(patch.v(), intervals);
  const SurfaceGrid<3> grid = evaluate_grid(patch, us, vs, 0);
  Eigen::Index best = 0;
  (sign * grid.points().row(axis)).maxCoeff(&best);

  const auto i = static_cast<std::size_t>(best) / vs.size();
  const auto j = static_cast<std::size_t>(best) % vs.size();
  const double step_u = i + 1 < us.size() ? us[i + 1] - us[i] : us[i] - us[i - 1];
  const double step_v = j + 1 < vs.size() ? vs[j + 1] - vs[j] : vs[j] - vs[j - 1];
  Vec3 direction = Vec3::Zero();
  direction(axis) = sign;
  return refine_extreme(patch, us[i], vs[j], step_u, step_v, direction);
}

}  // namespace

// The grid's box, with the patches that reach nearest to each of its sides searched further.
std::pair<Vec3, Vec3> tight_box(const BoundaryModel& model, const std::vector<FaceMeasure>& faces,
                                int intervals) {
  FaceMeasure all;
  for (const FaceMeasure& m : faces) {
    all.lowest_mm = all.lowest_mm.cwiseMin(m.lowest_mm);
    all.highest_mm = all.highest_mm.cwiseMax(m.highest_mm);
  }

  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      double& bound = sign < 0 ? all.lowest_mm(axis) : all.highest_mm(axis);
      const double from_grid = bound;
      for (std::size_t f = 0; f < faces.size(); ++f) {
        if (!model.faces[f].patch) continue;
        const double reach = sign < 0 ? faces[f].lowest_mm(axis) : faces[f].highest_mm(axis);
        const double slack = kGridSlack * (faces[f].highest_mm - faces[f].lowest_mm).norm();
        if (sign * (from_grid - reach) > slack) continue;
        const Vec3 p = extreme_of(*model.faces[f].patch, axis, sign, intervals);
        if (sign * (p(axis) - bound) > 0) bound = p(axis);
      }
    }
  }
  return {all.lowest_mm, all.highest_mm};
}

}  // namespace angiospline
