#include "modeling/check/certificate.h"

#include <algorithm>
#include <tuple>

#include "base/index.h"
#include "modeling/check/edge_measure.h"
#include "modeling/check/face_measure.h"
#include "modeling/check/self_intersection.h"
#include "modeling/solid/boundary_model.h"
#include "modeling/solid/solid_boundary.h"

namespace angiospline {
namespace {

// The figures that follow from topology alone. Handles are counted by the Euler characteristic of
// the closed shells: a face with w loops around it is a disc with w - 1 holes.
void measure_topology(const BoundaryModel& model, Certificate& certificate) {
  int characteristic = 0;
  std::vector<bool> used(index(model.vertex_count), false);

  // V - E + F, as vertices, edges and faces are met; a closed shell has each edge once each way.
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

void gather_faces(const BoundaryModel& model, const std::vector<FaceMeasure>& faces,
                  Certificate& certificate) {
  certificate.min_jacobian_ratio = 1.0;
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const BoundaryFace& face = model.faces[f];
    const FaceMeasure& m = faces[f];
    certificate.faces.push_back({face.name, face.kind, m.area_mm2});
    certificate.area_mm2 += m.area_mm2;

    // Only walls are asked whether they fold or bend: caps are plane.
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
  const std::vector<FaceMeasure> faces = measure_faces(model, options.samples_per_span, progress);
  progress.at("measure edges", 0.3);
  const std::vector<EdgeMeasure> edges =
      measure_edges(model, faces, options.samples_per_span, progress);
  if (progress.should_stop()) return fail(cancelled("measure"));

  gather_faces(model, faces, certificate);
  gather_edges(model, edges, certificate);
  std::tie(certificate.lowest_mm, certificate.highest_mm) =
      tight_box(model, faces, options.samples_per_span);
  const bool positive = gather_volumes(model, faces, certificate);
  certificate.valid = model.is_sound && model.solids > 0 && certificate.closed && positive;

  if (options.find_self_intersections) {
    Result<SelfIntersections> found =
        find_self_intersections(model, options.most_triangles, progress);
    if (!found) return fail(found.error());
    certificate.self_intersecting = !found->crossings.empty();
    certificate.self_intersections = std::move(found->crossings);
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
