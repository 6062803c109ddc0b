#include "recovery/thesis/deform/mesh.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include <Eigen/Geometry>

#include "base/index.h"

namespace angiospline {
namespace {

// The side that only one face has, by its first node: the next one along the opening. The face is
// on the left of its own sides.
std::map<int, int> open_sides(const DeformMesh& mesh) {
  std::vector<std::pair<int, int>> sides;
  for (const auto& f : mesh.faces)
    for (std::size_t k = 0; k < 4; ++k) sides.emplace_back(f[k], f[(k + 1) % 4]);
  std::sort(sides.begin(), sides.end());
  std::map<int, int> next;
  for (const auto& [a, b] : sides)
    if (!std::binary_search(sides.begin(), sides.end(), std::pair(b, a))) next[a] = b;
  return next;
}

}  // namespace

DeformMesh circle_contour(const Vec3& centre_mm, double radius_mm, int count) {
  EXPECTS(count >= 3 && radius_mm > 0);
  DeformMesh mesh;
  mesh.nodes_mm.resize(3, count);
  mesh.springs.resize(2, count);
  for (int k = 0; k < count; ++k) {
    const double a = 2 * std::numbers::pi * k / count;
    mesh.nodes_mm.col(k) = centre_mm + radius_mm * Vec3(std::cos(a), std::sin(a), 0);
    // In growing order: (0, 1), (0, count - 1), (1, 2), ...
    if (k == 0)
      mesh.springs.col(0) << 0, 1;
    else if (k == 1)
      mesh.springs.col(1) << 0, count - 1;
    else
      mesh.springs.col(k) << k - 1, k;
  }
  return mesh;
}

DeformMesh control_mesh(const SurfaceNetwork& network) {
  DeformMesh mesh;
  mesh.nodes_mm = network.control_points_mm;
  std::vector<std::pair<int, int>> springs;
  std::vector<char> used(index(mesh.node_count()), 0);

  // A quadrilateral between four control points of a patch, a spring along each of its sides.
  for (const Patch& patch : network.patches) {
    const int nu = patch.u.control_point_count(), nv = patch.v.control_point_count();
    const auto node = [&](int i, int j) { return patch.control[index(i) * nv + index(j)]; };
    const auto spring = [&](int a, int b) {
      if (a != b) springs.emplace_back(std::min(a, b), std::max(a, b));
    };
    for (const int k : patch.control) used[index(k)] = 1;
    for (int i = 0; i < nu; ++i)
      for (int j = 0; j < nv; ++j) {
        if (i + 1 < nu) spring(node(i, j), node(i + 1, j));
        if (j + 1 < nv) spring(node(i, j), node(i, j + 1));
        if (i + 1 < nu && j + 1 < nv)
          mesh.faces.push_back({node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)});
      }
  }

  // Each pair of neighbours once, in growing order.
  EXPECTS(std::find(used.begin(), used.end(), 0) == used.end());
  std::sort(springs.begin(), springs.end());
  springs.erase(std::unique(springs.begin(), springs.end()), springs.end());
  mesh.springs.resize(2, std::ssize(springs));
  for (std::size_t s = 0; s < springs.size(); ++s)
    mesh.springs.col(static_cast<Eigen::Index>(s)) << springs[s].first, springs[s].second;
  return mesh;
}

std::vector<std::vector<int>> neighbours(const DeformMesh& mesh) {
  std::vector<std::vector<int>> out(index(mesh.node_count()));
  for (Eigen::Index s = 0; s < mesh.springs.cols(); ++s) {
    const int a = mesh.springs(0, s), b = mesh.springs(1, s);
    out[index(a)].push_back(b);
    out[index(b)].push_back(a);
  }
  return out;
}

Points3 node_normals(const DeformMesh& mesh) {
  Points3 normals = Points3::Zero(3, mesh.node_count());
  const Points3& p = mesh.nodes_mm;
  if (mesh.is_contour()) {
    const int n = mesh.node_count();
    for (int k = 0; k < n; ++k) {
      const Vec3 side = p.col((k + 1) % n) - p.col(k);
      const Vec3 outward(side[1], -side[0], 0);
      normals.col(k) += outward;
      normals.col((k + 1) % n) += outward;
    }
  }
  // Half the cross product of the diagonals is a quadrilateral's area vector, plane or not.
  for (const auto& f : mesh.faces) {
    const Vec3 area = (p.col(f[2]) - p.col(f[0])).cross(Vec3(p.col(f[3]) - p.col(f[1])));
    for (const int k : f) normals.col(k) += area;
  }

  for (Eigen::Index k = 0; k < normals.cols(); ++k) {
    const double length = normals.col(k).norm();
    if (length > 0) normals.col(k) /= length;
  }
  return normals;
}

std::vector<std::vector<int>> openings(const DeformMesh& mesh) {
  std::map<int, int> next = open_sides(mesh);
  std::vector<std::vector<int>> loops;
  while (!next.empty()) {
    std::vector<int> loop;
    for (auto at = next.begin(); at != next.end();) {
      loop.push_back(at->first);
      const int to = at->second;
      next.erase(at);
      at = next.find(to);
    }
    loops.push_back(std::move(loop));
  }
  return loops;
}

std::optional<PeriodicGrid> periodic_grid(const DeformMesh& mesh) {
  PeriodicGrid grid;
  if (mesh.is_contour()) {
    grid.rows = 1;
    grid.columns = mesh.node_count();
    for (int k = 0; k < grid.columns; ++k) grid.order.push_back(k);
    return grid;
  }

  // Only a tube has two openings with as many nodes each; from one of them on its rows are found.
  const auto ends = openings(mesh);
  if (ends.size() != 2 || ends[0].size() != ends[1].size()) return std::nullopt;
  const auto near = neighbours(mesh);
  grid.columns = static_cast<int>(ends[0].size());
  std::vector<char> used(near.size(), 0);
  std::vector<int> row = ends[0];
  while (!row.empty()) {
    ++grid.rows;
    for (const int k : row) {
      grid.order.push_back(k);
      used[index(k)] = 1;
    }

    // The next row: of each node the one neighbour that is still free.
    std::vector<int> following;
    for (const int k : row) {
      std::vector<int> free;
      for (const int other : near[index(k)])
        if (used[index(other)] == 0) free.push_back(other);
      if (free.size() > 1) return std::nullopt;
      if (free.size() == 1) following.push_back(free.front());
    }
    if (!following.empty() && following.size() != row.size()) return std::nullopt;
    row = std::move(following);
  }
  if (grid.rows * grid.columns != mesh.node_count()) return std::nullopt;
  return grid;
}

TriangleMesh triangles_of(const DeformMesh& mesh, Caps caps) {
  const auto holes = caps == Caps::kFans ? openings(mesh) : std::vector<std::vector<int>>{};
  std::size_t fan = 0;
  for (const auto& hole : holes) fan += hole.size();

  TriangleMesh out;
  out.parts.push_back({"wall", PartKind::kBody, 0.0});
  out.points_mm.resize(3, mesh.node_count() + std::ssize(holes));
  out.points_mm.leftCols(mesh.node_count()) = mesh.nodes_mm;
  out.triangles.resize(3, static_cast<Eigen::Index>(2 * mesh.faces.size() + fan));

  Eigen::Index t = 0;
  for (const auto& f : mesh.faces) {
    out.triangles.col(t++) << f[0], f[1], f[2];
    out.triangles.col(t++) << f[0], f[2], f[3];
  }
  out.part_of.assign(index(out.triangles.cols()), 0);

  // A fan over each opening about the mean of its nodes, on the other side of the opening's loop.
  for (std::size_t h = 0; h < holes.size(); ++h) {
    const int apex = mesh.node_count() + static_cast<int>(h);
    out.parts.push_back({"cap_" + std::to_string(h + 1), PartKind::kCap, 0.0});
    Vec3 mean = Vec3::Zero();
    for (std::size_t k = 0; k < holes[h].size(); ++k) {
      const int a = holes[h][k], b = holes[h][(k + 1) % holes[h].size()];
      mean += mesh.nodes_mm.col(a) / static_cast<double>(holes[h].size());
      out.part_of[index(t)] = static_cast<int>(h) + 1;
      out.triangles.col(t++) << b, a, apex;
    }
    out.points_mm.col(apex) = mean;
  }
  return out;
}

}  // namespace angiospline
