#include "recovery/wall/wall_greys.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <unordered_set>

#include <tbb/parallel_for.h>

#include "base/index.h"
#include "base/median.h"
#include "recovery/wall/rules.h"

namespace angiospline {
namespace {

using namespace wall_rules;

std::vector<WallSides> all_sides(const GreyField& field, const FitMesh& mesh,
                                 const Eigen::VectorXd& displacement, double gate) {
  std::vector<WallSides> sides(mesh.nodes.size());
  tbb::parallel_for(std::size_t{0}, sides.size(), [&](std::size_t k) {
    const WallPoint p = parallel_point(mesh.nodes[k], displacement(static_cast<Eigen::Index>(k)));
    sides[k] = wall_sides(field, p, gate);
  });
  return sides;
}

double deviation_of(std::vector<double> residuals) {
  for (double& r : residuals) r = std::abs(r);
  return kNormalScale * median(std::move(residuals));
}

// The voxel whose centre is nearest to a place; nothing beyond the image.
std::optional<Voxel> voxel_at(const GreyField& field, const Vec3& p) {
  const ImageGrid& grid = field.image().grid;
  const Vec3 x = grid.index_vox(p);
  const Voxel v{static_cast<int>(std::lround(x(0))), static_cast<int>(std::lround(x(1))),
                static_cast<int>(std::lround(x(2)))};
  return grid.contains(v) ? std::optional(v) : std::nullopt;
}

// Voxels on one side of the wall, each once.
struct Side {
  std::vector<double> residuals;  // from the level there
  bool negative = false;          // whether any grey is
  std::unordered_set<std::size_t> seen;

  // The voxel nearest to a place, if the image has one.
  void add(const GreyField& field, const Vec3& p, double level) {
    const Image<float>& image = field.image();
    const auto v = voxel_at(field, p);
    if (!v || !seen.insert(image.grid.offset(*v)).second) return;
    residuals.push_back(static_cast<double>(image[*v]) - level);
    negative = negative || image[*v] < 0;
  }

  // As if there were one level; without outliers. Greys that would be negative for that are none.
  std::vector<double> greys(double level) const {
    const double reach = kNoiseRise * deviation_of(residuals);
    std::vector<double> all;
    for (const double r : residuals) {
      if (std::abs(r) <= reach) all.push_back(negative ? r + level : std::max(0.0, r + level));
    }
    return all;
  }
};

// Deviation of voxels two widths outside the wall from one level: noise, and the background's own
// variation.
double noise_beyond(const GreyField& field, const FitMesh& mesh,
                    const Eigen::VectorXd& displacement, double level) {
  Side side;
  for (std::size_t k = 0; k < mesh.nodes.size(); ++k) {
    const WallPoint p = parallel_point(mesh.nodes[k], displacement(static_cast<Eigen::Index>(k)));
    side.add(field, p.point_mm + 2 * field.width_mm(p.normal) * p.normal, level);
  }
  return deviation_of(side.residuals);
}

// Voxels up to four widths inside and outside the wall, each once: their deviations from the
// levels, and what those say about the noise.
void judge_noise(const GreyField& field, const FitMesh& mesh, const Eigen::VectorXd& displacement,
                 const Eigen::VectorXd& inner_weight, const Eigen::VectorXd& outer_weight,
                 double gate, WallGreys& greys) {
  Side inside, outside;
  for (Eigen::Index k = 0; k < mesh.size(); ++k) {
    const WallPoint p = parallel_point(mesh.nodes[index(k)], displacement(k));
    const double width = field.width_mm(p.normal);
    const double deepest = kBend / std::max(1e-300, p.largest_curvature);
    for (double s = kNoiseFrom; s <= kNoiseTo && inner_weight(k) > 0; s += 1) {
      if (s > kNoiseFrom && s * width > deepest) break;
      inside.add(field, p.point_mm - std::min(s * width, deepest) * p.normal, greys.inside(k));
    }
    // Outwards until another vessel begins.
    for (double s = kNoiseFrom; s <= kNoiseTo && outer_weight(k) > 0; s += 1) {
      const Vec3 place = p.point_mm + s * width * p.normal;
      if (!field.covers(place) || field.at(place) > greys.outside(k) + gate) break;
      outside.add(field, place, greys.outside(k));
    }
  }

  // Of white noise either side tells the deviation; the inside varies less by itself.
  const Side& better = inside.residuals.size() >= kFewestInside ? inside : outside;
  greys.noise = deviation_of(better.residuals);
  const NoiseVerdict verdict =
      noise_of(inside.greys(median({greys.inside.data(), greys.inside.data() + mesh.size()})),
               outside.greys(median({greys.outside.data(), greys.outside.data() + mesh.size()})));
  greys.kind = verdict.kind;
  if (greys.kind == NoiseKind::kRician) greys.noise = verdict.sigma;
}

double place_of(int j, double half_window) { return half_window * (2.0 * j / kSagSteps - 1); }

// An edge at (0) blurred by a Gaussian of deviation (1), bright on the negative side.
double blurred_edge(const Vec2& edge, double s) {
  return std::erfc((s - edge(0)) / (std::sqrt(2.0) * edge(1))) / 2;
}

// Two levels of a magnitude image. Shares of the amplitude between them become shares of the means.
class MagnitudeLevels {
 public:
  MagnitudeLevels(double outside, double inside, double sigma)
      : outside_(outside),
        contrast_(inside - outside),
        dark_(rician_amplitude(outside, sigma)),
        bright_(rician_amplitude(inside, sigma)),
        sigma_(sigma),
        least_(rician_mean(dark_, sigma)) {}

  double mean_of(double share) const {
    const double mean = rician_mean(dark_ + share * (bright_ - dark_), sigma_);
    return (mean - least_) / (outside_ + contrast_ - least_);
  }

  // Place and width of the blurred edge through these distances and means, by Gauss-Newton steps.
  Vec2 edge_through(const Eigen::MatrixX2d& means, double half_window) const {
    const auto misfit = [&](const Vec2& edge) {
      Eigen::VectorXd off(means.rows());
      for (Eigen::Index j = 0; j < means.rows(); ++j) {
        off(j) = mean_of(blurred_edge(edge, means(j, 0))) - means(j, 1);
      }
      return off;
    };

    Vec2 edge(0.0, kEdgeProfileFit.first_width);
    for (int round = 0; round < kEdgeProfileFit.rounds; ++round) {
      const Eigen::VectorXd off = misfit(edge);
      Eigen::MatrixX2d J(means.rows(), 2);
      for (int p = 0; p < 2; ++p) {
        J.col(p) = (misfit(edge + kEdgeProfileFit.difference * Vec2::Unit(p)) - off) /
                   kEdgeProfileFit.difference;
      }
      const Vec2 step = (J.transpose() * J).ldlt().solve(J.transpose() * off);
      if (!step.allFinite()) break;
      edge -= step.cwiseMax(-kEdgeProfileFit.longest_step).cwiseMin(kEdgeProfileFit.longest_step);
      edge(0) = std::clamp(edge(0), -half_window, half_window);
      edge(1) = std::clamp(edge(1), kEdgeProfileFit.narrowest, half_window);
    }
    return edge;
  }

 private:
  double outside_, contrast_, dark_, bright_, sigma_, least_;
};

// Voxels near the wall, from inside to outside in classes of their distance: in each row the mean
// distance, in voxel widths, and the mean normalised grey. Not interpolated: what bends greys has
// bent the voxels'.
Eigen::MatrixX2d voxels_across(const GreyField& field, const FitMesh& mesh, const WallGreys& greys,
                               const Eigen::VectorXd& displacement, double half_window) {
  Eigen::MatrixX3d sums = Eigen::MatrixX3d::Zero(kSagSteps, 3);
  for (Eigen::Index k = 0; k < mesh.size(); ++k) {
    const double contrast = greys.inside(k) - greys.outside(k);
    if (mesh.near_rim[index(k)] || contrast < kClearContrast * greys.contrast) continue;
    const WallPoint p = parallel_point(mesh.nodes[index(k)], displacement(k));
    const double width = field.width_mm(p.normal);

    // The voxels that the profile passes; each by where its centre is, not by where it was passed.
    for (int j = 0; j <= kSagSteps; j += 2) {
      const auto v = voxel_at(field, p.point_mm + place_of(j, half_window) * width * p.normal);
      if (!v) continue;
      const Vec3 center = field.image().grid.world_mm(*v);
      const double s = (center - p.point_mm).dot(p.normal) / width;
      const int row = static_cast<int>(std::floor((s / half_window + 1) / 2 * kSagSteps));
      if (row < 0 || row >= kSagSteps) continue;
      const double grey = static_cast<double>(field.image()[*v]);
      sums.row(row) += Eigen::RowVector3d(s, (grey - greys.outside(k)) / contrast, 1);
    }
  }

  // Classes that no voxel fell into have no row.
  Eigen::MatrixX2d means(0, 2);
  for (Eigen::Index row = 0; row < sums.rows(); ++row) {
    if (sums(row, 2) == 0) continue;
    means.conservativeResize(means.rows() + 1, 2);
    means.bottomRows(1) = sums.row(row).head<2>() / sums(row, 2);
  }
  return means;
}

}  // namespace

void weigh_outliers(const Eigen::VectorXd& residual, const Eigen::VectorXd& base, double floor,
                    Eigen::VectorXd& weights) {
  std::vector<double> known;
  for (Eigen::Index k = 0; k < base.size(); ++k) {
    if (base(k) > 0) known.push_back(residual(k));
  }
  const double reach = kOutlier * std::max(floor, deviation_of(known));
  for (Eigen::Index k = 0; k < base.size(); ++k) {
    const double r = residual(k) / reach;
    weights(k) = reach > 0 ? base(k) / std::max(1.0, r * r) : base(k);
  }
}

double WallGreys::snr() const {
  return noise * kBestSnr > std::abs(contrast) ? std::abs(contrast) / noise : kBestSnr;
}

double WallGreys::noise_density(const GreyField& field, double half_window_vox,
                                const MeshSmoother& smoother) const {
  const double voxel = field.voxel_mm();
  // Nodes farther apart than voxels see only part of the image.
  const double area = std::max(voxel * voxel, kNodeNoise * smoother.mass_mm2().mean());
  return 2 * half_window_vox * voxel * voxel * area / (snr() * snr());
}

namespace {

// Levels of the whole wall, and by how much grey may rise outside before it is another vessel's.
struct GlobalLevels {
  double inside, outside, gate;
};
GlobalLevels global_levels(const GreyField& field, const FitMesh& mesh,
                           const Eigen::VectorXd& displacement) {
  std::vector<double> in, out;
  const std::vector<WallSides> sides =
      all_sides(field, mesh, displacement, std::numeric_limits<double>::infinity());
  for (const WallSides& s : sides) {
    if (s.inside_weight > 0) in.push_back(s.inside);
    if (s.outside_weight > 0) out.push_back(s.outside);
  }

  if (in.empty()) {  // nothing but thin vessels: their middles, of which the brighter half is purer
    for (const WallPoint& node : mesh.nodes) {
      if (node.largest_curvature > 0) {
        in.push_back(field.at(node.point_mm - kBend / node.largest_curvature * node.normal));
      }
    }
  }

  const double inside = median(in);
  const double outside = median(out);
  const double noise = noise_beyond(field, mesh, displacement, outside);
  return {inside, outside,
          std::max(kNeighbourRise * std::abs(inside - outside), kNoiseRise * noise)};
}

}  // namespace

WallGreys wall_greys(const GreyField& field, const FitMesh& mesh, MeshSmoother& smoother,
                     const Eigen::VectorXd& displacement) {
  const Eigen::Index n = mesh.size();
  const auto [inside, outside, gate] = global_levels(field, mesh, displacement);
  const std::vector<WallSides> sides = all_sides(field, mesh, displacement, gate);

  // Deviations from the global levels at each node.
  Eigen::VectorXd inner(n), outer(n), inner_weight(n), outer_weight(n), waves(n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const WallSides& s = sides[index(k)];
    inner(k) = s.inside - inside;
    outer(k) = s.outside - outside;
    inner_weight(k) = mesh.near_rim[index(k)] ? 0.0 : s.inside_weight;
    outer_weight(k) = mesh.near_rim[index(k)] ? 0.0 : s.outside_weight;
    waves(k) = kOutsideWave * mesh.radii_mm[index(k)];
  }

  // Smoothed over the wall, a second time without what stands out of the first.
  const double radius = median(mesh.radii_mm);
  WallGreys greys;
  Eigen::VectorXd w_in = inner_weight, w_out = outer_weight;
  for (int round = 0; round < kLevelRounds; ++round) {
    greys.inside = smoother.mean(inner, w_in, kInsideMean * radius);
    greys.outside = smoother.fair(outer, w_out, waves);
    weigh_outliers(inner - greys.inside, inner_weight, 0.0, w_in);
    weigh_outliers(outer - greys.outside, outer_weight, 0.0, w_out);
  }

  greys.inside.array() += inside;
  greys.outside.array() += outside;
  const Eigen::VectorXd contrast = greys.inside - greys.outside;
  greys.contrast = median({contrast.data(), contrast.data() + n});
  judge_noise(field, mesh, displacement, inner_weight, outer_weight, gate, greys);
  return greys;
}

ProfileSag::ProfileSag(const GreyField& field, const FitMesh& mesh, const WallGreys& greys,
                       const Eigen::VectorXd& displacement, double half_window) {
  if (greys.kind != NoiseKind::kRician) return;
  const double outside = median({greys.outside.data(), greys.outside.data() + mesh.size()});
  const MagnitudeLevels levels(outside, outside + greys.contrast, greys.noise);
  const Vec2 edge = levels.edge_through(
      voxels_across(field, mesh, greys, displacement, half_window), half_window);
  for (int j = 0; j <= kSagSteps; ++j) {
    const double s = place_of(j, half_window);
    const double share = blurred_edge(edge, s);
    const double sag = levels.mean_of(share) - share;
    const double simpson = j == 0 || j == kSagSteps ? 1.0 : j % 2 == 1 ? 4.0 : 2.0;
    moments_ += simpson / 3 * 2 * half_window / kSagSteps * sag * Vec3(1, s, s * s);
  }
}

double ProfileSag::offset_mm(const GreyField& field, const WallPoint& p) const {
  const double width = field.width_mm(p.normal);
  const double twice_mean = (p.largest_curvature + p.smallest_curvature) * width;
  const double gauss = p.largest_curvature * p.smallest_curvature * width * width;
  return width * moments_.dot(Vec3(1, twice_mean, gauss));
}

}  // namespace angiospline
