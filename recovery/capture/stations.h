// Cross-sections along the branches of a tree, as a capture moves them.
#pragma once

#include <cmath>
#include <numbers>
#include <vector>

#include "kernel/spline/curve.h"
#include "modeling/tree/centerline_tree.h"
#include "recovery/wall/wall_profile.h"

namespace angiospline {

// A cross-section. Its frame is carried along the branch without turning.
struct CaptureStation {
  Vec3 center = Vec3::Zero();
  double radius = 1.0;
  double along = 0.0;
  Vec3 tangent = Vec3::Zero(), e1 = Vec3::Zero(), e2 = Vec3::Zero();
  bool clear = true;          // of other branches and of ends: it may be measured
  Vec3 start = Vec3::Zero();  // where it was to begin with
  double start_radius = 1.0;

  Vec3 direction(int k, int angles) const {
    const double a = 2 * std::numbers::pi * k / angles;
    return std::cos(a) * e1 + std::sin(a) * e2;
  }
};

struct CaptureBranch {
  std::vector<CaptureStation> stations;
  std::vector<WallLevels> levels;  // at each station
  double noise = 0.0;
  double evidence = 0.0;
};

// Sections of a path over its length, some half a radius apart, with their frames.
CaptureBranch sampled_branch(const BSplineCurve<4>& path, double voxel_mm);

// Tangents from the centres, and frames that do not turn about them.
void carry_frames(std::vector<CaptureStation>& stations);

// The station as it would be at a fraction in [-1/2, 1/2] of the way to its neighbours.
CaptureStation between(const std::vector<CaptureStation>& stations, std::size_t k, double fraction);

// Stations that are not clear move as the nearest clear one does.
void follow_clear(CaptureBranch& branch);

// Quarter, half, quarter averages of the moves along the branch.
void smooth_moves(CaptureBranch& branch, int passes);

// The tree with these sections for its branches, one for each (branches_at_nodes in `at_node`).
// Nodes move as the nearest measured stations of their branches do, in the mean; between a
// junction and its first measured station the move goes over from the one to the other.
// `mean_move_mm` is that of the clear ones.
CenterlineTree moved_tree(const CenterlineTree& tree, const std::vector<CaptureBranch>& branches,
                          const std::vector<std::vector<int>>& at_node, double& mean_move_mm);

}  // namespace angiospline
