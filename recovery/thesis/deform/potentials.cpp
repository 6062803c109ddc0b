#include "recovery/thesis/deform/potentials.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "kernel/geometry/point_index.h"
#include "recovery/thesis/deform/rules.h"

namespace angiospline {

EdgePoints edge_points(const EdgeField& field, const ImageGrid& grid) {
  EdgePoints out;
  const auto count = std::ssize(field.edges);
  out.at_mm.resize(3, count);
  out.normals.resize(3, count);
  out.strength.resize(count);
  for (Eigen::Index k = 0; k < count; ++k) {
    const Edge& e = field.edges[static_cast<std::size_t>(k)];
    out.at_mm.col(k) = grid.world_mm(e.voxel);
    out.normals.col(k) = field.normals[static_cast<std::size_t>(e.normal)];
    out.strength[k] = static_cast<double>(e.strength);
  }
  return out;
}

void NearestNodes::ask(const Points3& nodes, const std::vector<int>& which) {
  const PointIndex places_index(nodes);
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, which.size(), 256),
      [&](const tbb::blocked_range<std::size_t>& r) {
        for (std::size_t k = r.begin(); k != r.end(); ++k) {
          const int p = which[k];
          const auto [near, next] = places_index.nearest_two(points_.col(p));
          const double first = near.distance, second = next.distance;
          const double gap =
              second - first - deform_rules::kDistanceRounding * (first + second + travelled_);
          nearest_[static_cast<std::size_t>(p)] = static_cast<int>(near.point);
          good_until_[static_cast<std::size_t>(p)] = travelled_ + std::max(0.0, gap) / 2;
        }
      });
  asked_ += which.size();
}

const std::vector<int>& NearestNodes::update(const Points3& nodes) {
  EXPECTS(nodes.cols() >= 2);
  const auto count = static_cast<std::size_t>(points_.cols());
  if (nearest_.empty()) {
    nearest_.assign(count, -1);
    good_until_.assign(count, -1.0);
  } else {
    EXPECTS(nodes.cols() == last_.cols());
    travelled_ += std::sqrt((nodes - last_).colwise().squaredNorm().maxCoeff());
  }
  last_ = nodes;

  // An answer is in doubt once some node may have gone half the gap between the two nearest.
  std::vector<int> doubtful;
  for (std::size_t p = 0; p < count; ++p)
    if (!(travelled_ < good_until_[p])) doubtful.push_back(static_cast<int>(p));
  if (!doubtful.empty()) ask(nodes, doubtful);
  return nearest_;
}

EdgePotentials::EdgePotentials(EdgePoints edges, double voxel_mm, const PotentialOptions& options)
    : edges_(std::move(edges)), options_(options), nearest_(edges_.at_mm / voxel_mm) {
  edges_.at_mm /= voxel_mm;
  edges_.strength /= edges_.strength.maxCoeff();
}

Result<EdgePotentials> EdgePotentials::make(EdgePoints edges, double voxel_mm,
                                            const PotentialOptions& options) {
  const auto bad = [](const char* what, double value, const char* rule) {
    return fail({ErrorKind::kBadInput, what, "potentials", fmt::format("{}", value), rule});
  };
  const auto positive = [](double x) { return x > 0 && std::isfinite(x); };
  if (edges.count() == 0) return bad("there are no edges", 0, "nothing can pull the mesh");
  if (!positive(edges.strength.minCoeff()))
    return bad("an edge has no strength", edges.strength.minCoeff(), "strengths are above 0");
  if (!positive(options.strength))
    return bad("strength of the potentials is not usable", options.strength, "above 0");
  if (!positive(options.reach_vox))
    return bad("reach of the potentials is not usable", options.reach_vox, "voxels, above 0");
  if (!(options.core_vox >= 0) || !std::isfinite(options.core_vox))
    return bad("core of the potentials is not usable", options.core_vox, "voxels, at least 0");
  if (options.farthest_vox && !positive(*options.farthest_vox))
    return bad("farthest edge is not usable", *options.farthest_vox, "voxels, above 0");
  if (options.most_angle_deg && !positive(*options.most_angle_deg))
    return bad("largest angle is not usable", *options.most_angle_deg, "degrees, above 0");
  return EdgePotentials(std::move(edges), voxel_mm, options);
}

Points3 EdgePotentials::forces(const Points3& nodes_vox, const Points3& normals) {
  const std::vector<int>& nearest = nearest_.update(nodes_vox);
  const double least_cosine =
      options_.most_angle_deg ? std::cos(*options_.most_angle_deg * std::numbers::pi / 180) : -2;
  const double farthest = options_.farthest_vox.value_or(std::numeric_limits<double>::infinity());
  const double outward = options_.bright_inside ? -1 : 1;
  const double scale = options_.strength * static_cast<double>(nodes_vox.cols()) /
                       static_cast<double>(edges_.count());

  // Each edge pulls only the node nearest to it (6.2).
  Points3 sum = Points3::Zero(3, nodes_vox.cols());
  pulls_.assign(static_cast<std::size_t>(nodes_vox.cols()), 0);
  for (Eigen::Index e = 0; e < edges_.count(); ++e) {
    const int node = nearest[static_cast<std::size_t>(e)];

    // Gates against edges of other things.
    const Vec3 way = edges_.at_mm.col(e) - nodes_vox.col(node);
    const double r = way.norm();
    if (r == 0 || r > farthest) continue;
    if (least_cosine > -1 && outward * edges_.normals.col(e).dot(normals.col(node)) < least_cosine)
      continue;

    // Gravity as (6.1) has it, springs as (6.2), along the way to the edge.
    const double reach = options_.reach_vox;
    const double pull =
        options_.kind == PotentialKind::kGravity ? std::exp(-r * r / (reach * reach)) : r / reach;
    sum.col(node) += scale * edges_.strength[e] * pull / std::max(r, options_.core_vox) * way;
    ++pulls_[static_cast<std::size_t>(node)];
  }
  return sum;
}

double EdgePotentials::steepness() const {
  if (options_.kind == PotentialKind::kSpring) return options_.strength / options_.reach_vox;
  return options_.strength / (2 * std::max(options_.core_vox, 1.0));
}

}  // namespace angiospline
