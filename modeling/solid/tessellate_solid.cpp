#include "modeling/solid/tessellate_solid.h"

#include <map>
#include <numeric>
#include <utility>

#include "base/index.h"
#include "modeling/solid/boundary_mesh.h"
#include "modeling/solid/solid_boundary.h"

namespace angiospline {
namespace {

PartKind part_kind(const BoundaryFace& face) {
  switch (face.kind) {
    case FaceKind::kInlet:
      return PartKind::kInlet;
    case FaceKind::kOutlet:
      return PartKind::kOutlet;
    case FaceKind::kCap:
      return PartKind::kCap;
    case FaceKind::kWall:
      break;
  }
  return face.name.starts_with("junction") ? PartKind::kJunction : PartKind::kBody;
}

// The part of each face; faces of one name and kind share one.
std::vector<int> parts_of_faces(const BoundaryModel& model, std::vector<MeshPart>& parts) {
  std::map<std::pair<std::string, PartKind>, int> known;
  std::vector<int> part_of;
  for (const BoundaryFace& face : model.faces) {
    const PartKind kind = part_kind(face);
    const auto [at, is_new] = known.try_emplace({face.name, kind}, static_cast<int>(parts.size()));
    if (is_new) parts.push_back({face.name, kind, face.radius_mm});
    part_of.push_back(at->second);
  }
  return part_of;
}

void add_normals(TriangleMesh& mesh) {
  Points3 wall = Points3::Zero(3, mesh.points_mm.cols());
  Points3 cap = wall;
  for (Eigen::Index t = 0; t < mesh.triangles.cols(); ++t) {
    const Eigen::Vector3i corner = mesh.triangles.col(t);
    const Vec3 a = mesh.points_mm.col(corner[0]);
    const Vec3 twice_area =
        (mesh.points_mm.col(corner[1]) - a).cross(mesh.points_mm.col(corner[2]) - a);
    const PartKind kind = mesh.parts[index(mesh.part_of[index(t)])].kind;
    Points3& normals = is_wall(kind) ? wall : cap;
    for (int k = 0; k < 3; ++k) normals.col(corner[k]) += twice_area;
  }
  mesh.normals.resize(3, mesh.points_mm.cols());
  for (Eigen::Index p = 0; p < wall.cols(); ++p) {
    const Vec3 normal = wall.col(p).squaredNorm() > 0 ? wall.col(p) : cap.col(p);
    mesh.normals.col(p) = normal.squaredNorm() > 0 ? normal.normalized() : Vec3::UnitZ();
  }
}

}  // namespace

Result<TriangleMesh> tessellate(const Solid& solid, const SolidTessellationOptions& options,
                                const Progress& progress) {
  const auto model = boundary_of(solid, progress);
  if (!model) return fail(model.error());
  std::vector<int> faces(model->faces.size());
  std::iota(faces.begin(), faces.end(), 0);
  const BoundaryMesh boundary = mesh_boundary(*model, faces, {.turn_rad = options.turn_rad});
  if (boundary.triangles.empty()) {
    return fail({ErrorKind::kFailed, "nothing to tessellate", "solid", {}, "it has no faces"});
  }
  TriangleMesh mesh;
  const std::vector<int> part_of_face = parts_of_faces(*model, mesh.parts);
  mesh.points_mm = boundary.points;
  mesh.triangles.resize(3, static_cast<Eigen::Index>(boundary.triangles.size()));
  for (std::size_t t = 0; t < boundary.triangles.size(); ++t) {
    const auto& corner = boundary.triangles[t];
    mesh.triangles.col(static_cast<Eigen::Index>(t)) << corner[0], corner[1], corner[2];
    mesh.part_of.push_back(part_of_face[index(boundary.face_of[t])]);
  }
  add_normals(mesh);
  return mesh;
}

}  // namespace angiospline
