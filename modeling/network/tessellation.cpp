#include "modeling/network/tessellation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include <Eigen/Geometry>

#include "base/contract.h"
#include "base/index.h"
#include "kernel/evaluate/grid.h"
#include "modeling/network/mesh_spacing.h"

namespace angiospline {
namespace {

// A curve where patches meet or the surface ends: side a, and side b unless it lies on a rim.
struct Edge {
  Join join;
  int rim = -1;               // index of the rim, or -1 for a join
  std::vector<double> along;  // samples in [0, 1] of the join
  std::vector<int> points;    // of the mesh, one for each sample
};

// A use of an edge by a patch's side.
struct EdgeUse {
  int edge;
  bool is_b;
  double from;
};

bool runs_along_v(PatchSide side) { return side == PatchSide::kU0 || side == PatchSide::kU1; }

class Tessellator {
 public:
  Tessellator(const SurfaceNetwork& network, const TessellationOptions& options)
      : network_(network), options_(options) {}

  Result<Tessellation> run(const Progress& progress) {
    for (std::size_t p = 0; p < network_.patches.size(); ++p) {
      surfaces_.push_back(patch_surface(network_, static_cast<int>(p)));
    }
    auto spacing = spacing_of(network_, surfaces_, options_, progress);
    if (!spacing) return fail(spacing.error());
    spacings_ = std::move(spacing->patches);
    options_ = spacing->used;
    collect_edges();
    number_corners();
    sample_edges();
    for (std::size_t p = 0; p < network_.patches.size(); ++p) {
      if (progress.should_stop()) return fail(cancelled("tessellate"));
      mesh_patch(static_cast<int>(p));
      progress.at("tessellate", static_cast<double>(p + 1) / static_cast<double>(surfaces_.size()));
    }
    close_rims();
    return finish();
  }

 private:
  void use(const Side& side, int edge, bool is_b) {
    uses_[index(side.patch)][static_cast<std::size_t>(side.side)].push_back({edge, is_b, side.from});
  }

  void collect_edges() {
    uses_.resize(network_.patches.size());
    for (const Join& join : network_.joins) {
      use(join.a, static_cast<int>(edges_.size()), false);
      use(join.b, static_cast<int>(edges_.size()), true);
      edges_.push_back({join, -1, {}, {}});
    }
    for (std::size_t r = 0; r < network_.rims.size(); ++r) {
      for (const Side& side : network_.rims[r].sides) {
        use(side, static_cast<int>(edges_.size()), false);
        edges_.push_back({{side, side, false}, static_cast<int>(r), {}, {}});
      }
    }
    for (auto& sides : uses_) {
      for (auto& uses : sides) {
        std::sort(uses.begin(), uses.end(),
                  [](const EdgeUse& a, const EdgeUse& b) { return a.from < b.from; });
      }
    }
  }

  // Ends of edges are identified by combinatorics alone: neighbours on a side, sides at a corner of
  // a patch, and the two sides of a join. Distances play no part, so no gap can open.
  void number_corners() {
    std::vector<int> parent(2 * edges_.size());  // end 2 e + (0 start, 1 end) of edge e
    std::iota(parent.begin(), parent.end(), 0);
    const auto root = [&](int i) {
      while (parent[index(i)] != i) i = parent[index(i)] = parent[index(parent[index(i)])];
      return i;
    };
    const auto unite = [&](int a, int b) {
      a = root(a);
      b = root(b);
      parent[index(std::max(a, b))] = std::min(a, b);
    };
    // The end of a use at the low (0) or high (1) parameter of the patch's side.
    const auto end_of = [&](const EdgeUse& u, int high) {
      const bool flip = u.is_b && edges_[index(u.edge)].join.reversed;
      return 2 * u.edge + (flip ? 1 - high : high);
    };
    for (const auto& sides : uses_) {
      for (const auto& uses : sides) {
        for (std::size_t k = 1; k < uses.size(); ++k)
          unite(end_of(uses[k - 1], 1), end_of(uses[k], 0));
      }
      const auto& [u0, u1, v0, v1] = sides;
      unite(end_of(u0.front(), 0), end_of(v0.front(), 0));
      unite(end_of(u0.back(), 1), end_of(v1.front(), 0));
      unite(end_of(u1.front(), 0), end_of(v0.back(), 1));
      unite(end_of(u1.back(), 1), end_of(v1.back(), 1));
    }
    std::vector<int> number(parent.size(), -1);
    for (std::size_t e = 0; e < edges_.size(); ++e) {
      const Side& side = edges_[e].join.a;
      edges_[e].points.resize(2);
      for (const int end : {0, 1}) {
        int& n = number[index(root(2 * static_cast<int>(e) + end))];
        if (n < 0) n = add_point(side, end == 0 ? side.from : side.to);
        edges_[e].points[index(end)] = n;
      }
    }
  }

  int add_point(int patch, const Vec2& uv, const Vec3& position) {
    points_.push_back(position);
    normals_.emplace_back(Vec3::Zero());
    origins_.push_back({patch, uv});
    return static_cast<int>(points_.size()) - 1;
  }

  int add_point(const Side& side, double t) {
    const Vec2 uv = side_parameters(network_.patches[index(side.patch)], side.side, t);
    return add_point(side.patch, uv, surfaces_[index(side.patch)].at(uv.x(), uv.y()));
  }

  const Density& density_along(const Side& side) const {
    return angiospline::density_along(spacings_[index(side.patch)], side.side);
  }

  void sample_edges() {
    for (Edge& edge : edges_) {
      const Side& a = edge.join.a;
      const Side& b = edge.join.b;
      const Density& da = density_along(a);
      const Density& db = density_along(b);
      const std::size_t steps = 2 * std::max(da.parameters.size(), db.parameters.size());
      std::vector<double> density;
      for (std::size_t k = 0; k <= steps; ++k) {
        const double s = static_cast<double>(k) / static_cast<double>(steps);
        density.push_back(std::max(da(join_parameter_a(edge.join, s)) * (a.to - a.from),
                                   db(join_parameter_b(edge.join, s)) * (b.to - b.from)));
      }
      edge.along = equidistribute(density, 3);  // three: no two edges can share a segment
      const int last = edge.points.back();
      edge.points.pop_back();
      for (std::size_t k = 1; k + 1 < edge.along.size(); ++k) {
        edge.points.push_back(add_point(a, join_parameter_a(edge.join, edge.along[k])));
      }
      edge.points.push_back(last);
    }
  }

  // A chain of mesh points along a growing coordinate.
  struct Chain {
    std::vector<double> at;
    std::vector<int> points;

    void push(double t, int point) {
      at.push_back(t);
      points.push_back(point);
    }
    Chain reversed() const {
      Chain r{{at.rbegin(), at.rend()}, {points.rbegin(), points.rend()}};
      for (double& t : r.at) t = -t;
      return r;
    }
  };

  Chain side_chain(int patch, PatchSide side) const {
    Chain chain;
    for (const EdgeUse& u : uses_[index(patch)][static_cast<std::size_t>(side)]) {
      const Edge& edge = edges_[index(u.edge)];
      const std::size_t n = edge.along.size();
      const bool flip = u.is_b && edge.join.reversed;
      for (std::size_t k = 0; k < n; ++k) {
        const std::size_t i = flip ? n - 1 - k : k;
        if (k == 0 && !chain.points.empty()) continue;  // the end of the edge before
        chain.push(u.is_b ? join_parameter_b(edge.join, edge.along[i])
                          : join_parameter_a(edge.join, edge.along[i]),
                   edge.points[i]);
      }
    }
    return chain;
  }

  static std::vector<double> interior_lines(const KnotVector& knots, const Density& density) {
    const double width = knots.last() - knots.first();
    const std::size_t steps = 2 * density.parameters.size();
    std::vector<double> sampled;
    for (std::size_t k = 0; k <= steps; ++k) {
      const double t = knots.first() + width * static_cast<double>(k) / static_cast<double>(steps);
      sampled.push_back(density(t) * width);
    }
    std::vector<double> lines = equidistribute(sampled, 2);
    for (double& t : lines) t = knots.first() + t * width;
    return {lines.begin() + 1, lines.end() - 1};
  }

  void add_triangle(int a, int b, int c, int part) {
    triangles_.push_back({a, b, c});
    part_of_.push_back(part);
  }

  // A cell of the grid, counter-clockwise, cut along its shorter diagonal; a hair in favour of the
  // first keeps the choice from depending on the last bit.
  void add_cell(const std::array<int, 4>& c, int part) {
    const double first = (points_[index(c[0])] - points_[index(c[2])]).squaredNorm();
    const double second = (points_[index(c[1])] - points_[index(c[3])]).squaredNorm();
    if (first <= second * (1 + 1e-9)) {
      add_triangle(c[0], c[1], c[2], part);
      add_triangle(c[0], c[2], c[3], part);
    } else {
      add_triangle(c[0], c[1], c[3], part);
      add_triangle(c[1], c[2], c[3], part);
    }
  }

  // The strip between an outer chain and an inner one on its left, both growing.
  void zip(const Chain& outer, const Chain& inner, int part) {
    std::size_t o = 0;
    std::size_t i = 0;
    while (o + 1 < outer.points.size() || i + 1 < inner.points.size()) {
      const bool can_outer = o + 1 < outer.points.size();
      const bool can_inner = i + 1 < inner.points.size();
      if (can_outer &&
          (!can_inner || outer.at[o] + outer.at[o + 1] <= inner.at[i] + inner.at[i + 1])) {
        add_triangle(outer.points[o], outer.points[o + 1], inner.points[i], part);
        ++o;
      } else {
        add_triangle(outer.points[o], inner.points[i + 1], inner.points[i], part);
        ++i;
      }
    }
  }

  void add_side_normals(int patch, PatchSide side, const Chain& chain) {
    for (std::size_t k = 0; k < chain.points.size(); ++k) {
      const Vec2 uv = side_parameters(network_.patches[index(patch)], side, chain.at[k]);
      normals_[index(chain.points[k])] +=
          normal_vector(surfaces_[index(patch)], uv.x(), uv.y()).normalized();
    }
  }

  void mesh_patch(int patch) {
    const Patch& p = network_.patches[index(patch)];
    const std::vector<double> us = interior_lines(p.u, spacings_[index(patch)].u);
    const std::vector<double> vs = interior_lines(p.v, spacings_[index(patch)].v);
    const SurfaceGrid<3> grid = evaluate_grid(surfaces_[index(patch)], us, vs, 1);
    const int first = static_cast<int>(points_.size());
    const int rows = static_cast<int>(us.size());
    const int columns = static_cast<int>(vs.size());
    for (int i = 0; i < rows; ++i) {
      for (int j = 0; j < columns; ++j) {
        const Eigen::Index c = static_cast<Eigen::Index>(i) * columns + j;
        add_point(patch, {us[index(i)], vs[index(j)]}, grid.partial(0, 0).col(c));
        normals_.back() = Vec3(grid.partial(1, 0).col(c)).cross(Vec3(grid.partial(0, 1).col(c)));
      }
    }
    const auto interior = [&](int i, int j) { return first + i * columns + j; };
    for (int i = 0; i + 1 < rows; ++i) {
      for (int j = 0; j + 1 < columns; ++j) {
        add_cell({interior(i, j), interior(i + 1, j), interior(i + 1, j + 1), interior(i, j + 1)},
                 p.region);
      }
    }
    for (const PatchSide side : {PatchSide::kU0, PatchSide::kU1, PatchSide::kV0, PatchSide::kV1}) {
      const Chain outer = side_chain(patch, side);
      add_side_normals(patch, side, outer);
      Chain inner;
      if (runs_along_v(side)) {
        const int i = side == PatchSide::kU0 ? 0 : rows - 1;
        for (int j = 0; j < columns; ++j) inner.push(vs[index(j)], interior(i, j));
      } else {
        const int j = side == PatchSide::kV0 ? 0 : columns - 1;
        for (int i = 0; i < rows; ++i) inner.push(us[index(i)], interior(i, j));
      }
      // Counter-clockwise round the patch the interior is on the left.
      const bool forward = side == PatchSide::kV0 || side == PatchSide::kU1;
      zip(forward ? outer : outer.reversed(), forward ? inner : inner.reversed(), p.region);
    }
  }

  void close_rims() {
    const int first_part = static_cast<int>(network_.regions.size());
    std::vector<std::vector<std::array<int, 2>>> segments(network_.rims.size());
    for (const Edge& edge : edges_) {
      if (edge.rim < 0) continue;
      const PatchSide side = edge.join.a.side;
      const bool forward = side == PatchSide::kV0 || side == PatchSide::kU1;  // as the wall runs it
      for (std::size_t k = 0; k + 1 < edge.points.size(); ++k) {
        const std::array wall{edge.points[k], edge.points[k + 1]};
        segments[index(edge.rim)].push_back(forward ? std::array{wall[1], wall[0]} : wall);
      }
    }
    for (std::size_t r = 0; r < segments.size(); ++r) {
      fill_rim(closed_chain(std::move(segments[r])), network_.rims[r],
               first_part + static_cast<int>(r));
    }
  }

  // Directed segments as one loop, from the segment that was found first.
  static std::vector<int> closed_chain(std::vector<std::array<int, 2>> segments) {
    const int start = segments.front()[0];
    std::sort(segments.begin(), segments.end());
    std::vector<int> loop;
    int point = start;
    do {
      loop.push_back(point);
      const auto next = std::lower_bound(segments.begin(), segments.end(), std::array{point, -1});
      point = (*next)[1];
    } while (point != start && loop.size() < segments.size());
    return loop;
  }

  // Rings towards the middle, one segment's length apart, with ever fewer points; then a fan.
  void fill_rim(const std::vector<int>& loop, const Rim& rim, int part) {
    const auto count = static_cast<double>(loop.size());
    Vec3 center = Vec3::Zero();
    for (const int p : loop) center += points_[index(p)] / count;
    const int rings = std::max(1, static_cast<int>(std::lround(count / (2 * std::numbers::pi))));
    const auto on_loop = [&](double s) {  // at fraction s of the loop's segments
      const double k = s * count;
      const auto i = std::min(static_cast<std::size_t>(k), loop.size() - 1);
      const Vec3 a = points_[index(loop[i])];
      return Vec3(a +
                  (k - static_cast<double>(i)) * (points_[index(loop[(i + 1) % loop.size()])] - a));
    };
    Chain outer;
    for (std::size_t k = 0; k <= loop.size(); ++k) {
      outer.push(static_cast<double>(k) / count, loop[k % loop.size()]);
    }
    for (int ring = 1; ring <= rings; ++ring) {
      const double inward = static_cast<double>(ring) / rings;
      const int points = ring == rings ? 1 : std::max(5, static_cast<int>(count * (1 - inward)));
      Chain inner;
      for (int k = 0; k < points; ++k) {
        const double s = static_cast<double>(k) / points;
        inner.push(s, add_point(-1, Vec2::Zero(), center + (1 - inward) * (on_loop(s) - center)));
        normals_.back() = rim.normal;
      }
      if (points > 1) inner.push(1.0, inner.points.front());
      zip(outer, inner, part);
      outer = std::move(inner);
    }
  }

  Tessellation finish() {
    Tessellation result;
    TriangleMesh& mesh = result.mesh;
    mesh.points_mm.resize(3, static_cast<Eigen::Index>(points_.size()));
    mesh.normals.resize(3, mesh.points_mm.cols());
    for (Eigen::Index k = 0; k < mesh.points_mm.cols(); ++k) {
      mesh.points_mm.col(k) = points_[static_cast<std::size_t>(k)];
      mesh.normals.col(k) = normals_[static_cast<std::size_t>(k)].normalized();
    }
    points_ = {};  // large meshes are not held twice
    normals_ = {};
    mesh.triangles.resize(3, static_cast<Eigen::Index>(triangles_.size()));
    for (Eigen::Index t = 0; t < mesh.triangles.cols(); ++t) {
      const auto& [a, b, c] = triangles_[static_cast<std::size_t>(t)];
      mesh.triangles.col(t) << a, b, c;
    }
    triangles_ = {};
    mesh.part_of = std::move(part_of_);
    result.used = options_;
    result.origins = std::move(origins_);
    for (const Region& region : network_.regions) {
      const bool body = region.kind == RegionKind::kBody;
      mesh.parts.push_back(
          {region.name, body ? PartKind::kBody : PartKind::kJunction, region.radius_mm});
    }
    for (const Rim& rim : network_.rims) {
      const PartKind kind = rim.kind == RimKind::kInlet    ? PartKind::kInlet
                            : rim.kind == RimKind::kOutlet ? PartKind::kOutlet
                                                           : PartKind::kCap;
      mesh.parts.push_back({rim.name, kind, rim.radius_mm});
    }
    return result;
  }

  const SurfaceNetwork& network_;
  TessellationOptions options_;
  std::vector<BSplineSurface<3>> surfaces_;
  std::vector<PatchSpacing> spacings_;
  std::vector<Edge> edges_;
  std::vector<std::array<std::vector<EdgeUse>, 4>> uses_;
  std::vector<Vec3> points_;
  std::vector<Vec3> normals_;
  std::vector<PatchPoint> origins_;
  std::vector<std::array<int, 3>> triangles_;
  std::vector<int> part_of_;
};

}  // namespace

Result<Tessellation> tessellate(const SurfaceNetwork& network, const TessellationOptions& options,
                                const Progress& progress) {
  EXPECTS(options.chord_tolerance > 0 && options.chord_tolerance_mm > 0 &&
          options.longest_edge > 0 && options.most_triangles > 0);
  if (auto defect = find_defect(network)) return fail(*defect);
  return Tessellator(network, options).run(progress);
}

}  // namespace angiospline
