#include "io/meshes/part_arrays.h"

#include <Eigen/Geometry>

namespace angiospline {
namespace {

Vec3 area_vector(const TriangleMesh& mesh, int triangle) {
  const Vec3 a = mesh.points_mm.col(mesh.triangles(0, triangle));
  const Vec3 b = mesh.points_mm.col(mesh.triangles(1, triangle));
  const Vec3 c = mesh.points_mm.col(mesh.triangles(2, triangle));
  return (b - a).cross(c - a);
}

// The surface's normal, or the plane's where the surface has none.
Vec3 unit_normal(const Vec3& surface, const Vec3& plane) {
  if (surface.squaredNorm() > 0.25) return surface.normalized();
  return plane.squaredNorm() > 0 ? Vec3(plane.normalized()) : Vec3::UnitZ();
}

}  // namespace

std::vector<PartArrays> arrays_of_parts(const TriangleMesh& mesh) {
  std::vector<PartArrays> parts(mesh.parts.size());
  std::vector<Vec3> plane(mesh.parts.size(), Vec3::Zero());
  std::vector<std::vector<int>> triangles(mesh.parts.size());
  for (int t = 0; t < mesh.triangles.cols(); ++t) {
    const auto p = static_cast<std::size_t>(mesh.part_of[static_cast<std::size_t>(t)]);
    plane[p] += area_vector(mesh, t);
    triangles[p].push_back(t);
  }

  // A point on the border of two parts is one of each; it is numbered anew for every part.
  std::vector<std::uint32_t> number(static_cast<std::size_t>(mesh.points_mm.cols()));
  std::vector<int> numbered_for(number.size(), -1);
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const bool wall = is_wall(mesh.parts[p].kind);
    for (const int t : triangles[p]) {
      for (const int point : mesh.triangles.col(t)) {
        const auto i = static_cast<std::size_t>(point);
        if (numbered_for[i] != static_cast<int>(p)) {
          numbered_for[i] = static_cast<int>(p);
          number[i] = static_cast<std::uint32_t>(parts[p].points.size());
          parts[p].points.push_back(point);
          const bool smooth = wall && mesh.normals.cols() > 0;
          parts[p].normals.push_back(
              unit_normal(smooth ? Vec3(mesh.normals.col(point)) : Vec3::Zero(),
                          wall ? area_vector(mesh, t) : plane[p]));
        }
        parts[p].indices.push_back(number[i]);
      }
    }
  }
  return parts;
}

}  // namespace angiospline
