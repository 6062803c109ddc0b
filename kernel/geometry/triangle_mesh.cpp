#include "kernel/geometry/triangle_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Geometry>

#include "base/disjoint_sets.h"
#include "base/index.h"

namespace angiospline {
namespace {

// A triangle's side from `low` to `high` point, low < high; `forward` when the triangle runs it so.
struct HalfEdge {
  int low;
  int high;
  int triangle;
  bool forward;

  friend bool same_edge(const HalfEdge& a, const HalfEdge& b) {
    return a.low == b.low && a.high == b.high;
  }
};

std::vector<HalfEdge> sorted_half_edges(const TriangleMesh& mesh) {
  std::vector<HalfEdge> edges;
  edges.reserve(static_cast<std::size_t>(3 * mesh.triangles.cols()));
  for (int t = 0; t < mesh.triangles.cols(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const int a = mesh.triangles(k, t);
      const int b = mesh.triangles((k + 1) % 3, t);
      edges.push_back({std::min(a, b), std::max(a, b), t, a < b});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const HalfEdge& a, const HalfEdge& b) {
    return std::array{a.low, a.high, a.triangle} < std::array{b.low, b.high, b.triangle};
  });
  return edges;
}

// Corners (3 t + k) joined over shared edges: as many classes at a point as it has fans.
int count_points_of_several_fans(const TriangleMesh& mesh, const std::vector<HalfEdge>& edges) {
  DisjointSets fan_of_corner(index(3 * mesh.triangles.cols()));
  const auto corner = [&](int triangle, int point) {
    for (int k = 0; k < 3; ++k) {
      if (mesh.triangles(k, triangle) == point) return 3 * triangle + k;
    }
    return 3 * triangle;
  };

  for (std::size_t i = 1; i < edges.size(); ++i) {
    if (!same_edge(edges[i - 1], edges[i])) continue;
    for (const int point : {edges[i].low, edges[i].high}) {
      fan_of_corner.join(corner(edges[i - 1].triangle, point), corner(edges[i].triangle, point));
    }
  }

  std::vector<int> fans(static_cast<std::size_t>(mesh.points_mm.cols()), 0);
  for (int c = 0; c < static_cast<int>(fan_of_corner.size()); ++c) {
    if (fan_of_corner.root(c) == c) ++fans[index(mesh.triangles(c % 3, c / 3))];
  }
  return static_cast<int>(std::count_if(fans.begin(), fans.end(), [](int n) { return n > 1; }));
}

void count_edges(const std::vector<HalfEdge>& edges, MeshMeasure& m) {
  for (std::size_t i = 0; i < edges.size();) {
    std::size_t end = i + 1;
    while (end < edges.size() && same_edge(edges[i], edges[end])) ++end;
    const std::size_t uses = end - i;
    if (uses == 1) ++m.open_edges;
    if (uses > 2 || (uses == 2 && edges[i].forward == edges[i + 1].forward)) ++m.bad_edges;
    i = end;
  }
}

// Genus of each component of a closed mesh by points - edges + triangles = 2 - 2 genus.
std::vector<int> genus_of_components(const TriangleMesh& mesh, const std::vector<int>& component,
                                     int count) {
  std::vector<int> euler(static_cast<std::size_t>(count), 0);
  std::vector<int> component_of_point(static_cast<std::size_t>(mesh.points_mm.cols()), -1);
  std::vector<int> triangles(static_cast<std::size_t>(count), 0);
  for (int t = 0; t < mesh.triangles.cols(); ++t) {
    const int c = component[static_cast<std::size_t>(t)];
    ++triangles[static_cast<std::size_t>(c)];
    for (int k = 0; k < 3; ++k) {
      component_of_point[static_cast<std::size_t>(mesh.triangles(k, t))] = c;
    }
  }

  for (const int c : component_of_point) {
    if (c >= 0) ++euler[static_cast<std::size_t>(c)];
  }
  std::vector<int> genus;
  for (int c = 0; c < count; ++c) {  // closed: edges = 3/2 triangles
    const auto i = static_cast<std::size_t>(c);
    genus.push_back((2 - (euler[i] - triangles[i] / 2)) / 2);
  }
  std::sort(genus.begin(), genus.end());
  return genus;
}

}  // namespace

std::string to_string(PartKind kind) {
  switch (kind) {
    case PartKind::kBody:
      return "body";
    case PartKind::kJunction:
      return "junction";
    case PartKind::kInlet:
      return "inlet";
    case PartKind::kOutlet:
      return "outlet";
    case PartKind::kCap:
      break;
  }
  return "cap";
}

bool is_wall(PartKind kind) { return kind == PartKind::kBody || kind == PartKind::kJunction; }

PartKind part_kind_of_name(std::string_view name) {
  for (const PartKind kind :
       {PartKind::kJunction, PartKind::kInlet, PartKind::kOutlet, PartKind::kCap}) {
    if (name.rfind(to_string(kind), 0) == 0) return kind;
  }
  return PartKind::kBody;
}

std::vector<int> components_of_triangles(const TriangleMesh& mesh) {
  DisjointSets joined(index(mesh.points_mm.cols()));
  for (int t = 0; t < mesh.triangles.cols(); ++t) {
    joined.join(mesh.triangles(0, t), mesh.triangles(1, t));
    joined.join(mesh.triangles(1, t), mesh.triangles(2, t));
  }

  // Numbers go by the first triangle, not by the lowest point: points without one have none.
  std::vector<int> number(joined.size(), -1);
  std::vector<int> component;
  int count = 0;
  for (int t = 0; t < mesh.triangles.cols(); ++t) {
    int& n = number[index(joined.root(mesh.triangles(0, t)))];
    if (n < 0) n = count++;
    component.push_back(n);
  }
  return component;
}

MeshMeasure measure(const TriangleMesh& mesh) {
  MeshMeasure m;
  m.part_area_mm2.assign(mesh.parts.size(), 0.0);
  if (mesh.triangles.cols() == 0) return m;

  // Volumes are summed about a point of the mesh: far from the origin they would cancel.
  const Vec3 origin = mesh.points_mm.col(mesh.triangles(0, 0));
  m.lowest_mm = m.highest_mm = origin;
  for (int t = 0; t < mesh.triangles.cols(); ++t) {
    const Vec3 a = mesh.points_mm.col(mesh.triangles(0, t)) - origin;
    const Vec3 b = mesh.points_mm.col(mesh.triangles(1, t)) - origin;
    const Vec3 c = mesh.points_mm.col(mesh.triangles(2, t)) - origin;
    m.volume_mm3 += a.dot(b.cross(c)) / 6;
    const double area = 0.5 * (b - a).cross(c - a).norm();
    m.area_mm2 += area;
    m.part_area_mm2[static_cast<std::size_t>(mesh.part_of[static_cast<std::size_t>(t)])] += area;
    for (int k = 0; k < 3; ++k) {
      m.lowest_mm = m.lowest_mm.cwiseMin(mesh.points_mm.col(mesh.triangles(k, t)));
      m.highest_mm = m.highest_mm.cwiseMax(mesh.points_mm.col(mesh.triangles(k, t)));
    }
  }

  const std::vector<HalfEdge> edges = sorted_half_edges(mesh);
  count_edges(edges, m);
  m.bad_points = count_points_of_several_fans(mesh, edges);
  const std::vector<int> component = components_of_triangles(mesh);
  m.components = 1 + *std::max_element(component.begin(), component.end());
  if (m.closed()) m.genus = genus_of_components(mesh, component, m.components);
  return m;
}

std::optional<Error> find_defect(const TriangleMesh& mesh) {
  const auto defect = [](std::string what, std::string where, std::string value, std::string rule) {
    return Error{ErrorKind::kBadInput, std::move(what), std::move(where), std::move(value),
                 std::move(rule)};
  };
  if (mesh.part_of.size() != static_cast<std::size_t>(mesh.triangles.cols())) {
    return defect("wrong number of part indices", "mesh", std::to_string(mesh.part_of.size()),
                  "one for each triangle");
  }
  if (mesh.normals.cols() != 0 && mesh.normals.cols() != mesh.points_mm.cols()) {
    return defect("wrong number of normals", "mesh", std::to_string(mesh.normals.cols()),
                  "one for each point, or none");
  }

  for (int p = 0; p < mesh.points_mm.cols(); ++p) {
    if (!mesh.points_mm.col(p).allFinite()) {
      return defect("coordinate is not finite", "point " + std::to_string(p), {},
                    "coordinates are finite");
    }
  }

  for (int t = 0; t < mesh.triangles.cols(); ++t) {
    const std::string where = "triangle " + std::to_string(t);
    const int part = mesh.part_of[static_cast<std::size_t>(t)];
    if (part < 0 || part >= static_cast<int>(mesh.parts.size())) {
      return defect("triangle has no part", where, std::to_string(part), "an index into the parts");
    }
    for (int k = 0; k < 3; ++k) {
      const int p = mesh.triangles(k, t);
      if (p < 0 || p >= mesh.points_mm.cols()) {
        return defect("triangle names a point that is not there", where, std::to_string(p),
                      "0 to " + std::to_string(mesh.points_mm.cols() - 1));
      }
    }
  }
  return std::nullopt;
}

}  // namespace angiospline
