#include "modeling/self_intersection.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "modeling/boundary_mesh.h"
#include "modeling/triangle_crossing.h"

namespace angiospline {
namespace {

std::size_t index(int i) { return static_cast<std::size_t>(i); }

// A crossing that finer meshes of its two faces have as well, each four times as fine as the last.
std::optional<Vec3> confirmed(const BoundaryModel& model, const TriangleCrossing& crossing,
                              BoundaryMeshOptions options) {
  if (model.mesh_points.cols() > 0) return crossing.place;  // there is no finer one
  std::vector<int> faces{crossing.groups[0]};
  if (crossing.groups[1] != crossing.groups[0]) faces.push_back(crossing.groups[1]);
  std::optional<Vec3> place;
  for (const int finer : {4, 12}) {
    options.finer = finer;
    const BoundaryMesh mesh = mesh_boundary(model, faces, options);
    place.reset();
    for (const TriangleCrossing& c :
         crossing_triangles(mesh.points, mesh.triangles, mesh.face_of)) {
      if (c.groups == crossing.groups) place = c.place;
    }
    if (!place) return std::nullopt;
  }
  return place;
}

// Faces that lie loose side by side touch all along their edges, which triangles cannot tell from
// crossing: only where every edge has two faces are different faces compared.
bool has_free_edges(const BoundaryModel& model) {
  return std::any_of(model.edges.begin(), model.edges.end(), [](const BoundaryEdge& edge) {
    return !edge.is_degenerate && edge.uses.size() == 1;
  });
}

}  // namespace

Result<SelfIntersection> find_self_intersection(const BoundaryModel& model, int most_triangles,
                                                const Progress& progress) {
  progress.at("find self-intersections", 0.4);
  BoundaryMeshOptions options;
  const auto expected = static_cast<double>(expected_triangles(model, options));
  if (expected > most_triangles) options.turn_rad *= std::sqrt(expected / most_triangles);
  std::vector<int> faces(model.faces.size());
  std::iota(faces.begin(), faces.end(), 0);

  SelfIntersection result;
  for (const int f : faces) {
    result.resolution_mm = std::max(result.resolution_mm, chord_height_mm(model, f, options));
  }
  if (progress.should_stop()) return fail(cancelled("find self-intersections"));
  const BoundaryMesh mesh = mesh_boundary(model, faces, options);
  if (progress.should_stop()) return fail(cancelled("find self-intersections"));
  const std::vector<TriangleCrossing> crossings =
      crossing_triangles(mesh.points, mesh.triangles, mesh.face_of, progress);
  const bool is_open = has_free_edges(model);
  for (const TriangleCrossing& crossing : crossings) {
    if (is_open && crossing.groups[0] != crossing.groups[1]) continue;
    if (progress.should_stop()) return fail(cancelled("find self-intersections"));
    if (const auto place = confirmed(model, crossing, options)) {
      result.found = true;
      result.place_mm = *place;
      for (const std::size_t k : {0U, 1U}) {
        result.faces[k] = model.faces[index(crossing.groups[k])].name;
      }
      break;
    }
  }
  if (progress.should_stop()) return fail(cancelled("find self-intersections"));
  return result;
}

}  // namespace angiospline
