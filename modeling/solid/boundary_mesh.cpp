#include "modeling/solid/boundary_mesh.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <Eigen/Geometry>

#include "base/index.h"
#include "kernel/evaluate/grid.h"
#include "modeling/network/tessellation_draft.h"
#include "modeling/solid/rules.h"

namespace angiospline {
namespace {

struct GridLines {
  std::vector<double> us, vs;
};

using namespace solid_rules;

std::vector<double> divided(const std::vector<double>& breaks, const std::vector<int>& intervals) {
  std::vector<double> lines{breaks.front()};
  for (std::size_t k = 0; k + 1 < breaks.size(); ++k) {
    for (int i = 1; i < intervals[k]; ++i) {
      lines.push_back(breaks[k] + (breaks[k + 1] - breaks[k]) * i / intervals[k]);
    }
    lines.push_back(breaks[k + 1]);
  }
  return lines;
}

double angle(const Vec3& a, const Vec3& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }

// For each span of the first index, the largest turn of the tangent on any line along it.
std::vector<int> intervals_for(const Points3& tangents, int along, int across, int stride_along,
                               int stride_across, const BoundaryMeshOptions& options) {
  const int spans = (along - 1) / kTurnSamples;
  std::vector<int> result(index(spans), 1);
  for (int s = 0; s < spans; ++s) {
    double largest = 0;
    for (int j = 0; j < across; ++j) {
      double turn = 0;
      for (int i = s * kTurnSamples; i < (s + 1) * kTurnSamples; ++i) {
        turn += angle(tangents.col(i * stride_along + j * stride_across),
                      tangents.col((i + 1) * stride_along + j * stride_across));
      }
      largest = std::max(largest, turn);
    }
    result[index(s)] =
        options.finer *
        std::clamp(static_cast<int>(std::ceil(largest / options.turn_rad)), 1, kMostIntervals);
  }

  if (spans == 1 && result[0] < 2) result[0] = 2;  // so that there is a point inside
  return result;
}

GridLines grid_lines(const BSplineSurface<3>& patch, const BoundaryMeshOptions& options) {
  const std::vector<double> u_breaks = patch.u().breakpoints();
  const std::vector<double> v_breaks = patch.v().breakpoints();
  const std::vector<double> us =
      divided(u_breaks, std::vector<int>(u_breaks.size() - 1, kTurnSamples));
  const std::vector<double> vs =
      divided(v_breaks, std::vector<int>(v_breaks.size() - 1, kTurnSamples));
  const SurfaceGrid<3> grid = evaluate_grid(patch, us, vs, 1);
  return {divided(u_breaks, intervals_for(grid.partial(1, 0), grid.u_count, grid.v_count,
                                          grid.v_count, 1, options)),
          divided(v_breaks, intervals_for(grid.partial(0, 1), grid.v_count, grid.u_count, 1,
                                          grid.v_count, options))};
}

class Mesher {
 public:
  Mesher(const BoundaryModel& model, const std::vector<int>& faces,
         const BoundaryMeshOptions& options)
      : model_(model), faces_(faces), lines_(model.faces.size()), uses_(model.faces.size()) {
    // Whole patches get a grid of parameter lines, as dense as their tangents turn.
    std::vector<bool> wanted(model.faces.size(), false);
    for (const int f : faces) wanted[index(f)] = true;
    for (const int f : faces) {
      if (model.faces[index(f)].is_whole) {
        lines_[index(f)] = grid_lines(*model.faces[index(f)].patch, options);
      }
    }

    std::vector<int> edges;
    for (std::size_t e = 0; e < model.edges.size(); ++e) {
      const BoundaryEdge& edge = model.edges[e];
      bool is_used = false;
      for (std::size_t k = 0; k < edge.uses.size(); ++k) {
        const int f = edge.uses[k].face;
        if (!wanted[index(f)]) continue;
        uses_[index(f)].push_back({static_cast<int>(e), static_cast<int>(k)});
        is_used = true;
      }
      if (is_used) edges.push_back(static_cast<int>(e));
    }

    for (const int e : edges) divide_edge(e, wanted);
  }

  BoundaryMesh mesh() {
    for (const int f : faces_) {
      if (model_.faces[index(f)].is_whole) {
        mesh_patch(f);
      } else if (model_.faces[index(f)].plane) {
        mesh_plane(f);
      }
    }
    result_.points.resize(3, static_cast<Eigen::Index>(points_.size()));
    for (std::size_t k = 0; k < points_.size(); ++k) {
      result_.points.col(static_cast<Eigen::Index>(k)) = points_[k];
    }
    return std::move(result_);
  }

 private:
  struct FaceUse {
    int edge, use;
  };

  int add_point(const Vec3& p) {
    points_.push_back(p);
    return static_cast<int>(points_.size()) - 1;
  }
  int vertex_point(int vertex, const Vec3& p) {
    const auto [at, fresh] = vertices_.try_emplace(vertex, static_cast<int>(points_.size()));
    if (fresh) points_.push_back(p);
    return at->second;
  }

  // The edge's points: its ends, and where the grid lines of the finer of its faces meet it.
  void divide_edge(int number, const std::vector<bool>& wanted) {
    const BoundaryEdge& edge = model_.edges[index(number)];
    std::vector<double> inner;
    for (const EdgeUse& use : edge.uses) {
      const BoundaryFace& face = model_.faces[index(use.face)];
      if (!wanted[index(use.face)] || !face.is_whole) continue;
      const GridLines& lines = lines_[index(use.face)];
      const bool along_v = use.side == PatchSide::kU0 || use.side == PatchSide::kU1;
      std::vector<double> ts;
      for (const double p : along_v ? lines.vs : lines.us) {
        const double s = (p - use.side_from) / (use.side_to - use.side_from);
        if (s > kEdgeMargin && s < 1 - kEdgeMargin)
          ts.push_back(edge.from + s * (edge.to - edge.from));
      }
      if (ts.size() > inner.size()) inner = std::move(ts);
    }
    std::sort(inner.begin(), inner.end());

    MeshChain chain;
    const auto at = [&](double t) { return edge.point(t).at; };
    chain.push(edge.from, vertex_point(edge.first_vertex, at(edge.from)));
    for (const double t : inner) chain.push(t, add_point(at(t)));
    chain.push(edge.to, vertex_point(edge.last_vertex, at(edge.to)));
    chains_[number] = std::move(chain);
  }

  void add_triangle(int a, int b, int c, int face, bool flipped) {
    if (a == b || b == c || c == a) return;
    if (flipped) std::swap(b, c);
    result_.triangles.push_back({a, b, c});
    result_.face_of.push_back(face);
  }

  // The points of one side in growing parameter: of its edges one after another, each one's first
  // point being the last one's end.
  MeshChain side_chain(int face, PatchSide side) const {
    std::vector<MeshChain> pieces;
    for (const FaceUse& fu : uses_[index(face)]) {
      const BoundaryEdge& edge = model_.edges[index(fu.edge)];
      const EdgeUse& use = edge.uses[index(fu.use)];
      if (use.side != side) continue;
      MeshChain piece = chains_.at(fu.edge);
      for (double& t : piece.at) {
        const double s = (t - edge.from) / (edge.to - edge.from);
        t = use.side_from + s * (use.side_to - use.side_from);
      }
      if (use.side_from > use.side_to) {
        std::reverse(piece.at.begin(), piece.at.end());
        std::reverse(piece.points.begin(), piece.points.end());
      }
      pieces.push_back(std::move(piece));
    }

    std::sort(pieces.begin(), pieces.end(),
              [](const MeshChain& a, const MeshChain& b) { return a.at.front() < b.at.front(); });
    MeshChain chain;
    for (const MeshChain& piece : pieces) {
      for (std::size_t k = chain.at.empty() ? 0 : 1; k < piece.at.size(); ++k) {
        chain.push(piece.at[k], piece.points[k]);
      }
    }
    return chain;
  }

  // Triangles between a side's points and the grid line next to it.
  void add_strip(const MeshChain& outer, const MeshChain& inner, int face, bool flipped) {
    zip_chains(outer, inner, [&](int a, int b, int c) { add_triangle(a, b, c, face, flipped); });
  }

  void mesh_patch(int number) {
    const BoundaryFace& face = model_.faces[index(number)];
    const GridLines& lines = lines_[index(number)];
    const std::vector<double> us(lines.us.begin() + 1, lines.us.end() - 1);
    const std::vector<double> vs(lines.vs.begin() + 1, lines.vs.end() - 1);
    const SurfaceGrid<3> grid = evaluate_grid(*face.patch, us, vs, 0);
    const int first = static_cast<int>(points_.size());
    for (Eigen::Index k = 0; k < grid.points().cols(); ++k) add_point(grid.points().col(k));

    const int nu = static_cast<int>(us.size()), nv = static_cast<int>(vs.size());
    const auto at = [&](int i, int j) { return first + i * nv + j; };
    for (int i = 0; i + 1 < nu; ++i) {
      for (int j = 0; j + 1 < nv; ++j) {
        add_triangle(at(i, j), at(i + 1, j), at(i + 1, j + 1), number, face.reversed);
        add_triangle(at(i, j), at(i + 1, j + 1), at(i, j + 1), number, face.reversed);
      }
    }

    MeshChain low_u, high_u, low_v, high_v;
    for (int j = 0; j < nv; ++j) {
      low_u.push(vs[index(j)], at(0, j));
      high_u.push(vs[index(j)], at(nu - 1, j));
    }
    for (int i = 0; i < nu; ++i) {
      low_v.push(us[index(i)], at(i, 0));
      high_v.push(us[index(i)], at(i, nv - 1));
    }

    // Along v0 and u1 the inside lies to the left.
    add_strip(side_chain(number, PatchSide::kV0), low_v, number, face.reversed);
    add_strip(side_chain(number, PatchSide::kU1), high_u, number, face.reversed);
    add_strip(side_chain(number, PatchSide::kV1), high_v, number, !face.reversed);
    add_strip(side_chain(number, PatchSide::kU0), low_u, number, !face.reversed);
  }

  // The closed polygons around a plane face, counter-clockwise from outside.
  std::vector<std::vector<int>> polygons_of(int number) const {
    struct Piece {
      std::vector<int> points;
      bool taken = false;
    };
    std::vector<Piece> pieces;
    std::multimap<int, std::size_t> by_start;
    for (const FaceUse& fu : uses_[index(number)]) {
      Piece piece;
      piece.points = chains_.at(fu.edge).points;
      if (!model_.edges[index(fu.edge)].uses[index(fu.use)].forward) {
        std::reverse(piece.points.begin(), piece.points.end());
      }
      by_start.emplace(piece.points.front(), pieces.size());
      pieces.push_back(std::move(piece));
    }

    // From each piece on to one that starts where it ends, until none is left that does.
    std::vector<std::vector<int>> polygons;
    for (Piece& start : pieces) {
      if (start.taken) continue;
      std::vector<int> polygon;
      Piece* at = &start;
      while (at != nullptr) {
        at->taken = true;
        polygon.insert(polygon.end(), at->points.begin(), at->points.end() - 1);
        const int end = at->points.back();
        at = nullptr;
        const auto [low, high] = by_start.equal_range(end);
        for (auto next = low; next != high && at == nullptr; ++next) {
          if (!pieces[next->second].taken) at = &pieces[next->second];
        }
      }
      polygons.push_back(std::move(polygon));
    }
    return polygons;
  }

  void mesh_plane(int number) {
    const auto& [center, normal] = *model_.faces[index(number)].plane;
    for (const std::vector<int>& polygon : polygons_of(number)) {
      Vec3 middle = Vec3::Zero();
      for (const int p : polygon) middle += points_[index(p)] / static_cast<double>(polygon.size());

      // A fan about the middle, unless it would turn over somewhere.
      bool is_star = true;
      for (std::size_t k = 0; k < polygon.size(); ++k) {
        const Vec3 a = points_[index(polygon[k])] - middle;
        const Vec3 b = points_[index(polygon[(k + 1) % polygon.size()])] - middle;
        is_star = is_star && a.cross(b).dot(normal) > 0;
      }
      if (!is_star) {
        clip_ears(polygon, normal, number);
        continue;
      }
      const int hub = add_point(middle);
      for (std::size_t k = 0; k < polygon.size(); ++k) {
        add_triangle(hub, polygon[k], polygon[(k + 1) % polygon.size()], number, false);
      }
    }
  }

  // Cuts off a corner with nothing inside it again and again (Meisters 1975). Cubic at worst, but
  // only for caps that are not star-shaped.
  void clip_ears(std::vector<int> polygon, const Vec3& normal, int number) {
    const auto turn = [&](int a, int b, int c) {
      return (points_[index(b)] - points_[index(a)])
          .cross(points_[index(c)] - points_[index(b)])
          .dot(normal);
    };

    while (polygon.size() > 3) {
      // The first corner that turns the right way and has no other point in its triangle.
      const std::size_t n = polygon.size();
      std::size_t ear = 0;
      for (std::size_t k = 0; k < n; ++k) {
        const int a = polygon[(k + n - 1) % n], b = polygon[k], c = polygon[(k + 1) % n];
        if (!(turn(a, b, c) > 0)) continue;
        const bool is_empty = std::none_of(polygon.begin(), polygon.end(), [&](int p) {
          return p != a && p != b && p != c && turn(a, b, p) > 0 && turn(b, c, p) > 0 &&
                 turn(c, a, p) > 0;
        });
        if (is_empty) {
          ear = k;
          break;
        }
      }
      add_triangle(polygon[(ear + n - 1) % n], polygon[ear], polygon[(ear + 1) % n], number, false);
      polygon.erase(polygon.begin() + static_cast<std::ptrdiff_t>(ear));
    }
    if (polygon.size() == 3) add_triangle(polygon[0], polygon[1], polygon[2], number, false);
  }

  const BoundaryModel& model_;
  const std::vector<int>& faces_;
  std::vector<GridLines> lines_;
  std::vector<std::vector<FaceUse>> uses_;
  std::map<int, MeshChain> chains_;
  std::map<int, int> vertices_;
  std::vector<Vec3> points_;
  BoundaryMesh result_;
};

}  // namespace

BoundaryMesh mesh_boundary(const BoundaryModel& model, const std::vector<int>& faces,
                           const BoundaryMeshOptions& options) {
  if (model.mesh_points.cols() > 0) {
    BoundaryMesh mesh;
    mesh.points = model.mesh_points;
    for (const int f : faces) {
      for (const std::array<int, 3>& t : model.faces[index(f)].mesh.triangles) {
        mesh.triangles.push_back(t);
        mesh.face_of.push_back(f);
      }
    }
    return mesh;
  }
  return Mesher(model, faces, options).mesh();
}

std::size_t expected_triangles(const BoundaryModel& model, const BoundaryMeshOptions& options) {
  if (model.mesh_points.cols() > 0) {
    std::size_t count = 0;
    for (const BoundaryFace& face : model.faces) count += face.mesh.triangles.size();
    return count;
  }
  std::size_t count = 0;
  for (const BoundaryFace& face : model.faces) {
    if (!face.is_whole) continue;
    const GridLines lines = grid_lines(*face.patch, options);
    count += 2 * (lines.us.size() - 1) * (lines.vs.size() - 1);
  }
  return count;
}

double chord_height_mm(const BoundaryModel& model, int number, const BoundaryMeshOptions& options) {
  const BoundaryFace& face = model.faces[index(number)];
  if (model.mesh_points.cols() > 0) return model.mesh_deflection_mm;
  if (!face.is_whole) return 0.0;
  const GridLines lines = grid_lines(*face.patch, options);

  const auto middles = [](const std::vector<double>& a) {
    std::vector<double> result;
    for (std::size_t k = 0; k + 1 < a.size(); ++k) result.push_back(0.5 * (a[k] + a[k + 1]));
    return result;
  };

  const SurfaceGrid<3> corners = evaluate_grid(*face.patch, lines.us, lines.vs, 0);
  const SurfaceGrid<3> centers =
      evaluate_grid(*face.patch, middles(lines.us), middles(lines.vs), 0);
  double largest = 0;
  for (int i = 0; i < centers.u_count; ++i) {
    for (int j = 0; j < centers.v_count; ++j) {
      // The cell's diagonal runs from its lowest to its highest corner.
      const Vec3 flat = 0.5 * (corners.points().col(i * corners.v_count + j) +
                               corners.points().col((i + 1) * corners.v_count + j + 1));
      largest = std::max(largest, (centers.points().col(i * centers.v_count + j) - flat).norm());
    }
  }
  return largest;
}

}  // namespace angiospline
