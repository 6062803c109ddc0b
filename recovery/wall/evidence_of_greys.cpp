#include "recovery/wall/evidence_of_greys.h"

#include <algorithm>

#include <tbb/parallel_for.h>

#include "base/index.h"
#include "base/median.h"
#include "recovery/wall/rules.h"

namespace angiospline {

using namespace wall_rules;

void EvidenceOfGreys::look(const FitMesh& mesh, MeshSmoother& smoother,
                           const Eigen::VectorXd& displacement) {
  if (levels_are_known_) return;

  // The levels are taken from a smoother wall: one that follows the noise would have bright noise
  // inside and dark noise outside.
  const Eigen::VectorXd broad = smoother.mean(displacement, Eigen::VectorXd::Ones(mesh.size()),
                                              kLevelMean * median(mesh.radii_mm));
  greys_ = wall_greys(field_, mesh, smoother, broad);
}

WallOffsets EvidenceOfGreys::offsets(const FitMesh& mesh, const Eigen::VectorXd& displacement,
                                     double half_window) const {
  const ProfileSag sag(field_, mesh, greys_, displacement, half_window);
  WallOffsets all{Eigen::VectorXd::Zero(mesh.size()), Eigen::VectorXd::Zero(mesh.size())};
  tbb::parallel_for(std::size_t{0}, mesh.nodes.size(), [&](std::size_t i) {
    const auto k = static_cast<Eigen::Index>(i);
    const WallLevels levels{greys_.inside(k), greys_.outside(k)};
    const bool clear = levels.contrast() >= kLeastContrast * greys_.contrast;
    if (mesh.near_rim[i] || !clear) return;

    const WallPoint p = parallel_point(mesh.nodes[i], displacement(k));
    const WallOffset offset =
        wall_offset(field_, p, levels, {half_window, std::min(greys_.noise, greys_.contrast)});
    if (!offset.measured) return;

    // The variance of a sum grows with its window and falls with the square of the contrast.
    all.mm(k) = offset.offset_mm - sag.offset_mm(field_, p);
    const double relative = levels.contrast() / greys_.contrast;
    all.weight(k) =
        std::min(1.0, relative * relative) * 2 * half_window * field_.voxel_mm() / offset.window_mm;
  });
  return all;
}

std::vector<double> EvidenceOfGreys::support(const FitMesh& mesh,
                                             const Eigen::VectorXd& displacement) const {
  const int regions = *std::max_element(mesh.regions.begin(), mesh.regions.end()) + 1;
  std::vector<double> sum(index(regions), 0.0), count(index(regions), 0.0);
  for (std::size_t k = 0; k < mesh.nodes.size(); ++k) {
    const WallPoint p = parallel_point(mesh.nodes[k], displacement(static_cast<Eigen::Index>(k)));
    const double width = field_.width_mm(p.normal);
    const double in = std::min(width, kBend / std::max(1e-300, p.largest_curvature));
    // A voxel's width to either side, but not past the centre of a thin vessel.
    const Vec3 inner = p.point_mm - in * p.normal;
    const Vec3 outer = p.point_mm + width * p.normal;
    if (!field_.covers(inner) || !field_.covers(outer)) continue;
    sum[index(mesh.regions[k])] += (field_.at(inner) - field_.at(outer)) / greys_.contrast;
    count[index(mesh.regions[k])] += 1;
  }

  for (std::size_t r = 0; r < sum.size(); ++r) sum[r] = count[r] > 0 ? sum[r] / count[r] : 0.0;
  return sum;
}

}  // namespace angiospline
