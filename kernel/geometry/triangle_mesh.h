// A triangle mesh with named parts, and what can be measured on it.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "base/result.h"
#include "base/vector.h"

namespace angiospline {

// What a part of a surface is. Bodies and junctions are the wall; the others close its ends.
enum class PartKind { kBody, kJunction, kInlet, kOutlet, kCap };

// "body", "junction", "inlet", "outlet", "cap"; and whether the part belongs to the wall.
std::string to_string(PartKind kind);
bool is_wall(PartKind kind);

// The kind a name tells: "junction*", "inlet*", "outlet*", "cap*"; anything else is a body.
PartKind part_kind_of_name(std::string_view name);

struct MeshPart {
  std::string name;
  PartKind kind = PartKind::kBody;
  double radius_mm = 0.0;  // smallest vessel radius where known, otherwise 0
};

// Triangles on shared points, counter-clockwise seen from outside, each in one part.
struct TriangleMesh {
  Points3 points_mm;
  Eigen::Matrix3Xi triangles;  // columns of points_mm
  std::vector<int> part_of;    // for each triangle: index into parts
  std::vector<MeshPart> parts;

  // Unit normals of the wall at each point, or empty. A point that no wall triangle uses has the
  // normal of its cap. Caps are plane: their triangles use plane normals, also on the rim.
  Points3 normals;
};

// One number at each point of a mesh: a residual, a deviation, a curvature.
struct MeshField {
  std::string name;        // with its unit: "distance_mm"
  Eigen::VectorXd values;  // one for each point; NaN where not known
};

// What a mesh is as a surface. A closed, orientable, connected surface without boundary has
// Euler characteristic 2 - 2 genus.
struct MeshMeasure {
  double volume_mm3 = 0.0;  // signed; positive for a closed mesh wound outward
  double area_mm2 = 0.0;
  Vec3 lowest_mm = Vec3::Zero();  // corners of the bounding box of the triangles
  Vec3 highest_mm = Vec3::Zero();
  std::vector<double> part_area_mm2;
  int components = 0;      // of the triangles, over shared points
  int open_edges = 0;      // edges of one triangle
  int bad_edges = 0;       // of more than two, or of two that disagree in direction
  int bad_points = 0;      // whose triangles form more than one fan
  std::vector<int> genus;  // of each component, ascending; empty unless the mesh is closed

  bool closed() const { return open_edges == 0 && bad_edges == 0 && bad_points == 0; }
};

// An empty mesh measures zero everywhere. O(n log n) in the number of triangles.
MeshMeasure measure(const TriangleMesh& mesh);

// The component of each triangle, numbered by the lowest triangle.
std::vector<int> components_of_triangles(const TriangleMesh& mesh);

// The first broken invariant: indices in range, a part for each triangle, finite coordinates,
// normals as many as points.
std::optional<Error> find_defect(const TriangleMesh& mesh);

}  // namespace angiospline
