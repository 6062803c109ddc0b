#include "recovery/fit/fit_junction.h"

#include <algorithm>
#include <array>
#include <optional>
#include <span>

#include <Eigen/Geometry>

#include "base/index.h"
#include "recovery/fit/rules.h"

namespace angiospline {
namespace {

using namespace fit_rules;

// Slots of all points; the axis of each ring, or nothing if its second row does not follow one.
std::optional<std::vector<Vec3>> free_points(const SurfaceNetwork& network,
                                             const std::vector<StripRing>& rings,
                                             PatchGroup& group) {
  JunctionNet& net = group.net;
  std::vector<Vec3> axes;
  std::size_t first = 0;
  for (const StripRing& ring : rings) {
    Vec3 axis = Vec3::Zero(), center = Vec3::Zero();
    for (int c = 0; c < ring.points(); ++c) {
      const Vec3 rim = network.control_points_mm.col(ring.columns(0, c));
      axis += rim - network.control_points_mm.col(ring.columns(1, c));
      center += rim / ring.points();
    }

    axis.normalize();

    // Every point of the second row has to lie behind its own of the rim.
    double radius = 0;
    for (int c = 0; c < ring.points(); ++c) {
      const Vec3 rim = network.control_points_mm.col(ring.columns(0, c));
      const Vec3 step = rim - network.control_points_mm.col(ring.columns(1, c));
      if (step.cross(axis).norm() > 1e-7 * step.norm() || step.dot(axis) <= 0) return {};
      radius += (rim - center).norm() / ring.points();
    }

    for (std::size_t k = 0; k < ring.patches.size(); ++k) {
      const std::array<int, kPatchPoints>& control = group.controls[first + k];
      for (int i = 0; i < kPatchSize; ++i) {
        for (int j = 0; j < kPatchSize; ++j) {
          const std::size_t id = index(control[index(i * kPatchSize + j)]);
          net.scale[id] = std::min(net.scale[id], radius);
          if (i <= 1) net.slots[id] = {-1, i, -axis};
        }
      }
      axes.push_back(axis);  // one for each patch, in the order of group.patches
    }
    first += ring.patches.size();
  }

  number_unknowns(group);
  return axes;
}

// The equations of all inner edges; false if one is not a leg or a saddle.
bool make_edges(const SurfaceNetwork& network, const std::vector<Vec3>& axes, PatchGroup& group) {
  const EdgeDegrees degrees;
  for (const Join& join : network.joins) {
    const int a = group.index_of(join.a.patch);
    if (a < 0 || group.index_of(join.b.patch) < 0) continue;

    const bool leg = (join.a.side == PatchSide::kV0 && join.b.side == PatchSide::kV1) ||
                     (join.a.side == PatchSide::kV1 && join.b.side == PatchSide::kV0);
    const bool saddle = join.a.side == PatchSide::kU1 && join.b.side == PatchSide::kU1;

    if (!leg && !saddle) return false;
    if (leg) {
      add_leg(group, join, degrees.leg, axes[index(a)]);
    } else {
      add_edge(group, join, degrees.saddle);
    }
  }
  return !group.edges.edges.empty();
}

MovedPatches refused(std::string why) { return {{}, 0.0, std::move(why), 0.0, 0.0}; }

MovedPatches move_from(PatchGroup& group, const std::vector<PatchSample>& samples,
                       const Points3& start, const PatchWeights& weights,
                       std::span<const double> roughness) {
  const double wanted = std::max(kLeastJacobianRatio, 0.5 * jacobian_ratio(group));
  const MovedGroup moved = move_group(group, samples, start, weights, roughness, wanted);
  MovedPatches result{{}, moved.share, moved.failure, moved.worst_angle_deg, moved.jacobian_ratio};
  for (std::size_t k = 0; k < group.columns.size(); ++k) {
    result.points[group.columns[k]] = group.net.points.col(static_cast<Eigen::Index>(k));
  }
  return result;
}

}  // namespace

MovedPatches move_junction(const SurfaceNetwork& network, const std::vector<StripRing>& rings,
                           const std::map<int, Vec3>& openings,
                           const std::vector<PatchSample>& samples) {
  std::vector<int> patches;
  for (const StripRing& ring : rings) {
    if (ring.rows() != kPatchSize) return refused("its patches are not bi-quintic Bezier patches");
    patches.insert(patches.end(), ring.patches.begin(), ring.patches.end());
  }
  PatchGroup group = patch_group(network, patches);
  const auto axes = free_points(network, rings, group);
  if (!axes) return refused("its tangent planes do not contain the axes of its branches");
  if (!make_edges(network, *axes, group) || !is_smooth(group)) {
    return refused("it is not smooth to begin with");
  }

  // The openings take the rows next to them along.
  std::map<int, Vec3> shift;
  for (const StripRing& ring : rings) {
    for (int c = 0; c < ring.points(); ++c) {
      const auto found = openings.find(ring.columns(0, c));
      if (found == openings.end()) continue;
      const Vec3 by = found->second - network.control_points_mm.col(ring.columns(0, c));
      shift[ring.columns(0, c)] = by;
      shift[ring.columns(1, c)] = by;
    }
  }
  Points3 start = Points3::Zero(3, group.net.points.cols());
  for (std::size_t k = 0; k < group.columns.size(); ++k) {
    const auto found = shift.find(group.columns[k]);
    if (found != shift.end()) start.col(static_cast<Eigen::Index>(k)) = found->second;
  }
  PatchWeights weights;
  weights.anchor = kAnchor;
  return move_from(group, samples, start, weights, kRoughness);
}

MovedPatches move_closed(const SurfaceNetwork& network, const std::vector<int>& patches,
                         double radius_mm, const std::vector<PatchSample>& samples) {
  PatchGroup group = patch_group(network, patches);
  std::fill(group.net.scale.begin(), group.net.scale.end(), radius_mm);
  number_unknowns(group);
  for (const Join& join : network.joins) {
    if (group.index_of(join.a.patch) < 0 || group.index_of(join.b.patch) < 0) continue;
    add_edge(group, join, kClosedRatioDegree);
  }
  if (!is_smooth(group)) return refused("it is not smooth to begin with");
  PatchWeights weights;
  weights.anchor = kAnchor;
  const Points3 start = Points3::Zero(3, group.net.points.cols());
  return move_from(group, samples, start, weights, kClosedRoughness);
}

}  // namespace angiospline
