#include "modeling/check/edge_measure.h"

#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <tbb/parallel_for.h>

#include "base/index.h"
#include "kernel/evaluate/grid.h"
#include "modeling/check/rules.h"

namespace angiospline {
namespace {

using namespace check_rules;

std::vector<double> edge_samples(const BoundaryEdge& edge, int intervals) {
  std::vector<double> samples{edge.breaks.front()};
  for (std::size_t k = 0; k + 1 < edge.breaks.size(); ++k) {
    const double step = (edge.breaks[k + 1] - edge.breaks[k]) / intervals;
    for (int i = 1; i < intervals; ++i) samples.push_back(edge.breaks[k] + i * step);
    samples.push_back(edge.breaks[k + 1]);
  }
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
  for (const double share : kInsideShares) {
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

  // All samples of a side are one row of a grid.
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
            : normal_inside(patch, side_parameters(patch, use.side, along[index(k)]), least);
  }
  if (face.reversed) line.normals = -line.normals;
  return line;
}

EdgeLine line_on(const BoundaryFace& face, const BoundaryEdge& edge, const EdgeUse& use,
                 const std::vector<double>& ts, double least) {
  if (face.is_whole) return line_on_patch(face, edge, use, ts, least);

  // A plane's own point is the edge's beside it; other faces have theirs by their parameters.
  const auto count = static_cast<Eigen::Index>(ts.size());
  EdgeLine line{Points3(3, count), Points3::Zero(3, count)};
  for (Eigen::Index k = 0; k < count; ++k) {
    const double t = ts[index(k)];
    if (face.plane) {
      const auto& [center, normal] = *face.plane;
      const Vec3 p = edge.point(t).at;
      line.points.col(k) = p - (p - center).dot(normal) * normal;
      line.normals.col(k) = normal;
    } else if (use.parameters) {
      const Vec2 uv = use.parameters(t).at;
      const SurfaceJet jet = face.jet(uv.x(), uv.y());
      const Vec3 normal = jet.u.cross(jet.v);
      line.points.col(k) = jet.point;
      if (normal.norm() > least) line.normals.col(k) = normal.normalized();
      if (face.reversed) line.normals.col(k) = -line.normals.col(k);
    } else {
      line.points.col(k) = edge.point(t).at;
    }
  }
  return line;
}

double angle_between(const Vec3& a, const Vec3& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / std::numbers::pi;
}

EdgeMeasure measure_edge(const BoundaryModel& model, const BoundaryEdge& edge,
                         const std::vector<FaceMeasure>& faces, int intervals) {
  EdgeMeasure result;
  if (!is_shared(edge)) return result;
  const std::vector<double> ts = edge_samples(edge, intervals);
  const auto line = [&](const EdgeUse& use) {
    const double least = kDegenerateNormal * faces[index(use.face)].mean_jacobian;
    return line_on(model.faces[index(use.face)], edge, use, ts, least);
  };
  const EdgeLine a = line(edge.uses[0]);
  const EdgeLine b = line(edge.uses[1]);
  result.samples = static_cast<int>(ts.size());
  result.gap_mm = (a.points - b.points).colwise().norm().maxCoeff();
  if (!is_smooth(model, edge)) return result;

  // Between the walls' normals; a sample where either has none says nothing.
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

}  // namespace

bool is_shared(const BoundaryEdge& edge) { return !edge.is_degenerate && edge.uses.size() == 2; }

bool is_smooth(const BoundaryModel& model, const BoundaryEdge& edge) {
  return is_shared(edge) && model.faces[index(edge.uses[0].face)].kind == FaceKind::kWall &&
         model.faces[index(edge.uses[1].face)].kind == FaceKind::kWall;
}

std::vector<EdgeMeasure> measure_edges(const BoundaryModel& model,
                                       const std::vector<FaceMeasure>& faces, int intervals,
                                       const Progress& progress) {
  std::vector<EdgeMeasure> measures(model.edges.size());
  tbb::parallel_for(std::size_t{0}, measures.size(), [&](std::size_t e) {
    if (!progress.should_stop()) {
      measures[e] = measure_edge(model, model.edges[e], faces, intervals);
    }
  });
  return measures;
}

}  // namespace angiospline
