#include "recovery/fit/figures.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <tbb/parallel_for.h>

#include "kernel/geometry/triangle_tree.h"

namespace angiospline {

std::vector<PartFigures> part_figures(const TriangleMesh& mesh, const MeshField& residual,
                                      const TriangleMesh& before) {
  const auto at = [](Eigen::Index i) { return static_cast<std::size_t>(i); };
  const TriangleTree tree(before);
  std::vector<double> moved(at(mesh.points_mm.cols()));
  tbb::parallel_for(std::size_t{0}, moved.size(), [&](std::size_t k) {
    moved[k] = std::sqrt(
        tree.nearest(mesh.points_mm.col(static_cast<Eigen::Index>(k))).squared_distance_mm2);
  });

  std::vector<PartFigures> figures(mesh.parts.size() + 1);
  std::vector<double> area(figures.size(), 0.0), known(figures.size(), 0.0);
  for (std::size_t p = 0; p < mesh.parts.size(); ++p) figures[p].name = mesh.parts[p].name;
  figures.back().name = "all";

  // Means over area: each corner stands for a third of its triangle.
  for (Eigen::Index t = 0; t < mesh.triangles.cols(); ++t) {
    const std::size_t part = at(mesh.part_of[at(t)]);
    if (!is_wall(mesh.parts[part].kind)) continue;
    const Eigen::Vector3i c = mesh.triangles.col(t);
    const Vec3 a = mesh.points_mm.col(c(0));
    const double weight =
        (mesh.points_mm.col(c(1)) - a).cross(mesh.points_mm.col(c(2)) - a).norm() / 6;

    for (const std::size_t p : {part, figures.size() - 1}) {
      for (const int k : c) {
        figures[p].moved_mean_mm += weight * moved[at(k)];
        figures[p].moved_most_mm = std::max(figures[p].moved_most_mm, moved[at(k)]);
        area[p] += weight;
        const double left = std::abs(residual.values(k));
        if (!std::isfinite(left)) continue;
        figures[p].residual_mean += weight * left;
        figures[p].residual_most = std::max(figures[p].residual_most, left);
        known[p] += weight;
      }
    }
  }

  std::vector<PartFigures> kept;
  for (std::size_t p = 0; p < figures.size(); ++p) {
    if (area[p] > 0) figures[p].moved_mean_mm /= area[p];
    if (known[p] > 0) figures[p].residual_mean /= known[p];
    if (p + 1 == figures.size() || is_wall(mesh.parts[p].kind)) kept.push_back(figures[p]);
  }
  return kept;
}

}  // namespace angiospline
