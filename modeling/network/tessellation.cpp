#include "modeling/network/tessellation.h"

#include <utility>

#include <Eigen/Geometry>

#include "base/contract.h"
#include "base/index.h"
#include "kernel/evaluate/grid.h"
#include "modeling/network/mesh_spacing.h"
#include "modeling/network/rules.h"
#include "modeling/network/tessellation_draft.h"
#include "modeling/network/tessellation_edges.h"

namespace angiospline {
namespace {

using namespace network_rules;

// Parameter lines strictly inside a patch, as dense as one direction of it asks for.
std::vector<double> interior_lines(const KnotVector& knots, const Density& density) {
  const double width = knots.last() - knots.first();
  const std::size_t steps = 2 * density.parameters.size();
  std::vector<double> sampled;
  for (std::size_t k = 0; k <= steps; ++k) {
    const double t = knots.first() + width * static_cast<double>(k) / static_cast<double>(steps);
    sampled.push_back(density(t) * width);
  }
  std::vector<double> lines = equidistribute(sampled, kLeastLineSegments);
  for (double& t : lines) t = knots.first() + t * width;
  return {lines.begin() + 1, lines.end() - 1};
}

// The inner points of a patch, rows along u, and the triangles between them.
struct InnerGrid {
  std::vector<double> us, vs;
  int first = 0;  // mesh point of the first

  int at(int i, int j) const { return first + i * static_cast<int>(vs.size()) + j; }
  int rows() const { return static_cast<int>(us.size()); }
  int columns() const { return static_cast<int>(vs.size()); }

  // The row or column of points beside a side of the patch.
  MeshChain beside(PatchSide side) const {
    MeshChain chain;
    if (side == PatchSide::kU0 || side == PatchSide::kU1) {
      const int i = side == PatchSide::kU0 ? 0 : rows() - 1;
      for (int j = 0; j < columns(); ++j) chain.push(vs[index(j)], at(i, j));
    } else {
      const int j = side == PatchSide::kV0 ? 0 : columns() - 1;
      for (int i = 0; i < rows(); ++i) chain.push(us[index(i)], at(i, j));
    }
    return chain;
  }
};

InnerGrid add_inner_grid(const Patch& patch, int number, const BSplineSurface<3>& surface,
                         const PatchSpacing& spacing, TessellationDraft& draft) {
  InnerGrid inner{interior_lines(patch.u, spacing.u), interior_lines(patch.v, spacing.v),
                  static_cast<int>(draft.points.size())};
  const SurfaceGrid<3> grid = evaluate_grid(surface, inner.us, inner.vs, 1);
  for (int i = 0; i < inner.rows(); ++i) {
    for (int j = 0; j < inner.columns(); ++j) {
      const Eigen::Index c = static_cast<Eigen::Index>(i) * inner.columns() + j;
      draft.add_point({number, {inner.us[index(i)], inner.vs[index(j)]}},
                      grid.partial(0, 0).col(c));
      draft.normals.back() = Vec3(grid.partial(1, 0).col(c)).cross(Vec3(grid.partial(0, 1).col(c)));
    }
  }

  for (int i = 0; i + 1 < inner.rows(); ++i) {
    for (int j = 0; j + 1 < inner.columns(); ++j) {
      draft.add_cell(
          {inner.at(i, j), inner.at(i + 1, j), inner.at(i + 1, j + 1), inner.at(i, j + 1)},
          patch.region);
    }
  }
  return inner;
}

// Patches that meet at a point each add their unit normal there.
void add_side_normals(const Patch& patch, const BSplineSurface<3>& surface, PatchSide side,
                      const MeshChain& chain, TessellationDraft& draft) {
  for (std::size_t k = 0; k < chain.points.size(); ++k) {
    const Vec2 uv = side_parameters(patch, side, chain.at[k]);
    draft.normals[index(chain.points[k])] += normal_vector(surface, uv.x(), uv.y()).normalized();
  }
}

void mesh_patch(const SurfaceNetwork& network, int number, const BSplineSurface<3>& surface,
                const PatchSpacing& spacing, const TessellationEdges& edges,
                TessellationDraft& draft) {
  const Patch& patch = network.patches[index(number)];
  const InnerGrid grid = add_inner_grid(patch, number, surface, spacing, draft);

  // Strips between the sides and the outermost lines of the grid.
  for (const PatchSide side : {PatchSide::kU0, PatchSide::kU1, PatchSide::kV0, PatchSide::kV1}) {
    const MeshChain outer = edges.side_chain(number, side);
    const MeshChain inner = grid.beside(side);
    add_side_normals(patch, surface, side, outer, draft);
    // Counter-clockwise round the patch the interior is on the left.
    if (side == PatchSide::kV0 || side == PatchSide::kU1) {
      draft.add_strip(outer, inner, patch.region);
    } else {
      draft.add_strip(outer.reversed(), inner.reversed(), patch.region);
    }
  }
}

std::vector<MeshPart> parts_of(const SurfaceNetwork& network) {
  std::vector<MeshPart> parts;
  for (const Region& region : network.regions) {
    const bool body = region.kind == RegionKind::kBody;
    parts.push_back({region.name, body ? PartKind::kBody : PartKind::kJunction, region.radius_mm});
  }
  for (const Rim& rim : network.rims) {
    const PartKind kind = rim.kind == RimKind::kInlet    ? PartKind::kInlet
                          : rim.kind == RimKind::kOutlet ? PartKind::kOutlet
                                                         : PartKind::kCap;
    parts.push_back({rim.name, kind, rim.radius_mm});
  }
  return parts;
}

// The draft as a mesh. It gives up its points as they are copied: large meshes are not held twice.
Tessellation finished(TessellationDraft draft, const SurfaceNetwork& network,
                      const TessellationOptions& used) {
  Tessellation result;
  TriangleMesh& mesh = result.mesh;
  mesh.points_mm.resize(3, static_cast<Eigen::Index>(draft.points.size()));
  mesh.normals.resize(3, mesh.points_mm.cols());
  for (Eigen::Index k = 0; k < mesh.points_mm.cols(); ++k) {
    mesh.points_mm.col(k) = draft.points[index(k)];
    mesh.normals.col(k) = draft.normals[index(k)].normalized();
  }
  draft.points = {};
  draft.normals = {};

  mesh.triangles.resize(3, static_cast<Eigen::Index>(draft.triangles.size()));
  for (Eigen::Index t = 0; t < mesh.triangles.cols(); ++t) {
    const auto& [a, b, c] = draft.triangles[index(t)];
    mesh.triangles.col(t) << a, b, c;
  }
  draft.triangles = {};
  mesh.part_of = std::move(draft.part_of);
  mesh.parts = parts_of(network);
  result.origins = std::move(draft.origins);
  result.used = used;
  return result;
}

}  // namespace

Result<Tessellation> tessellate(const SurfaceNetwork& network, const TessellationOptions& options,
                                const Progress& progress) {
  EXPECTS(options.chord_tolerance > 0 && options.chord_tolerance_mm > 0 &&
          options.longest_edge > 0 && options.most_triangles > 0);
  if (auto defect = find_defect(network)) return fail(*defect);
  std::vector<BSplineSurface<3>> surfaces;
  for (std::size_t p = 0; p < network.patches.size(); ++p) {
    surfaces.push_back(patch_surface(network, static_cast<int>(p)));
  }

  // The second derivatives' demand (Filip, Magedson, Markot 1986), patch by patch.
  const auto spacing = spacing_of(network, surfaces, options, progress);
  if (!spacing) return fail(spacing.error());

  TessellationDraft draft;
  const TessellationEdges edges(network, surfaces, spacing->patches, draft);
  for (std::size_t p = 0; p < network.patches.size(); ++p) {
    if (progress.should_stop()) return fail(cancelled("tessellate"));
    mesh_patch(network, static_cast<int>(p), surfaces[p], spacing->patches[p], edges, draft);
    progress.at("tessellate", static_cast<double>(p + 1) / static_cast<double>(surfaces.size()));
  }
  add_caps(network.rims, edges.rim_loops(), static_cast<int>(network.regions.size()), draft);
  return finished(std::move(draft), network, spacing->used);
}

}  // namespace angiospline
