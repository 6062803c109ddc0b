#include "modeling/check/self_intersection.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include <tbb/parallel_for.h>

#include "base/index.h"
#include "kernel/geometry/triangle_crossing.h"
#include "modeling/check/rules.h"
#include "modeling/solid/boundary_mesh.h"

namespace angiospline {
namespace {

// The place of a crossing that finer meshes of its two faces have as well.
std::optional<Vec3> confirmed(const BoundaryModel& model, const TriangleCrossing& crossing,
                              BoundaryMeshOptions options) {
  if (model.mesh_points.cols() > 0) return crossing.place;  // there is no finer one
  std::vector<int> faces{crossing.groups[0]};
  if (crossing.groups[1] != crossing.groups[0]) faces.push_back(crossing.groups[1]);

  std::optional<Vec3> place;
  for (const int finer : check_rules::kFinerMeshes) {
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

Result<SelfIntersections> find_self_intersections(const BoundaryModel& model, int most_triangles,
                                                  const Progress& progress) {
  const auto stopped = [] { return fail(cancelled("find self-intersections")); };
  progress.at("find self-intersections", 0.4);

  // As fine as the number of triangles allows: they fall with the square of the chords' turn.
  BoundaryMeshOptions options;
  const auto expected = static_cast<double>(expected_triangles(model, options));
  if (expected > most_triangles) options.turn_rad *= std::sqrt(expected / most_triangles);
  std::vector<int> faces(model.faces.size());
  std::iota(faces.begin(), faces.end(), 0);

  // What is thinner than the mesh's own distance from the surface may be missed, and is said.
  SelfIntersections result;
  std::vector<double> heights(faces.size(), 0.0);
  tbb::parallel_for(std::size_t{0}, faces.size(), [&](std::size_t f) {
    if (!progress.should_stop()) heights[f] = chord_height_mm(model, faces[f], options);
  });
  for (const double h : heights) result.resolution_mm = std::max(result.resolution_mm, h);
  if (progress.should_stop()) return stopped();

  const BoundaryMesh mesh = mesh_boundary(model, faces, options);
  if (progress.should_stop()) return stopped();
  const std::vector<TriangleCrossing> crossings =
      crossing_triangles(mesh.points, mesh.triangles, mesh.face_of, progress);

  // One crossing for each pair of names, once a finer mesh has it too.
  const bool is_open = has_free_edges(model);
  std::set<std::array<std::string, 2>> named;
  for (const TriangleCrossing& crossing : crossings) {
    if (progress.should_stop()) return stopped();
    if (is_open && crossing.groups[0] != crossing.groups[1]) continue;
    FaceCrossing found;
    for (const std::size_t k : {0U, 1U})
      found.faces[k] = model.faces[index(crossing.groups[k])].name;
    if (named.contains(found.faces)) continue;
    if (const auto place = confirmed(model, crossing, options)) {
      found.at_mm = *place;
      named.insert(found.faces);
      result.crossings.push_back(std::move(found));
    }
  }
  if (progress.should_stop()) return stopped();
  return result;
}

}  // namespace angiospline
