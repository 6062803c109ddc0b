#include "recovery/capture/stations.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "base/index.h"
#include "recovery/capture/rules.h"

namespace angiospline {
namespace {

using namespace capture_rules;

// Moves the points from a branch's end to its first measured station over to the node.
void blend_to_node(CenterlineBranch& branch, const std::vector<CaptureStation>& stations,
                   const Vec3& node, bool at_end) {
  const std::size_t n = stations.size();
  std::size_t first = 0;
  while (first < n && !stations[at_end ? n - 1 - first : first].clear) ++first;
  first = std::max<std::size_t>(first, 1);
  const Vec3 missing = node - branch.points_mm.col(at_end ? branch.points_mm.cols() - 1 : 0);
  for (std::size_t k = 0; k < std::min(first, n); ++k) {
    const double share = 1 - static_cast<double>(k) / static_cast<double>(first);
    branch.points_mm.col(static_cast<Eigen::Index>(at_end ? n - 1 - k : k)) += share * missing;
  }
}

}  // namespace

void carry_frames(std::vector<CaptureStation>& stations) {
  const std::size_t n = stations.size();
  for (std::size_t k = 0; k < n; ++k) {
    const Vec3 d = stations[std::min(k + 1, n - 1)].center - stations[k > 0 ? k - 1 : 0].center;
    if (d.norm() > 0) stations[k].tangent = d.normalized();
    Vec3 e = k > 0 ? stations[k - 1].e1 : Vec3(stations[k].tangent.unitOrthogonal());
    e -= e.dot(stations[k].tangent) * stations[k].tangent;
    stations[k].e1 = e.norm() > 1e-3 ? Vec3(e.normalized()) : stations[k].tangent.unitOrthogonal();
    stations[k].e2 = stations[k].tangent.cross(stations[k].e1);
  }
}

CaptureBranch sampled_branch(const BSplineCurve<4>& path, double voxel) {
  const double length = path.knots().last() - path.knots().first();
  const double radius = path.at(path.knots().first() + length / 2)(3);
  const double step = std::max(kStationVox * voxel, kStationRadii * radius);
  const int count = std::max(kFewestStations, static_cast<int>(std::ceil(length / step)) + 1);

  CaptureBranch branch;
  for (int k = 0; k < count; ++k) {
    CaptureStation s;
    s.along = length * k / (count - 1);
    const Vec4 value = path.at(path.knots().first() + s.along);
    s.center = s.start = value.head<3>();
    s.radius = s.start_radius = value(3);
    branch.stations.push_back(s);
  }
  carry_frames(branch.stations);
  return branch;
}

CaptureStation between(const std::vector<CaptureStation>& stations, std::size_t k,
                       double fraction) {
  CaptureStation s = stations[k];
  const std::size_t other =
      fraction < 0 ? (k > 0 ? k - 1 : k) : std::min(k + 1, stations.size() - 1);
  const double w = std::abs(fraction);
  s.center += w * (stations[other].center - s.center);
  s.radius += w * (stations[other].radius - s.radius);
  return s;
}

void follow_clear(CaptureBranch& branch) {
  std::vector<std::size_t> clear;
  for (std::size_t k = 0; k < branch.stations.size(); ++k) {
    if (branch.stations[k].clear) clear.push_back(k);
  }
  if (clear.empty()) return;

  for (std::size_t k = 0; k < branch.stations.size(); ++k) {
    CaptureStation& s = branch.stations[k];
    if (s.clear) continue;

    // The nearest clear station, the earlier of two that are equally near.
    const auto after = std::lower_bound(clear.begin(), clear.end(), k);
    const std::size_t nearest = after == clear.begin() ? clear.front()
                                : *(after - 1) < k     ? *(after - 1)
                                                       : *after;
    const std::size_t other = after == clear.end() ? clear.back() : *after;
    const std::size_t from =
        other > k && (nearest > k || other - k < k - nearest) ? other : nearest;

    // Its move across this station's own axis, and its growth.
    const CaptureStation& guide = branch.stations[from];
    Vec3 move = guide.center - guide.start;
    move -= move.dot(s.tangent) * s.tangent;
    s.center = s.start + move;
    s.radius = s.start_radius * guide.radius / guide.start_radius;
  }
}

void smooth_moves(CaptureBranch& branch, int passes) {
  const std::size_t n = branch.stations.size();
  for (int pass = 0; pass < passes; ++pass) {
    const std::vector<CaptureStation> now = branch.stations;
    for (std::size_t k = 1; k + 1 < n; ++k) {
      const auto move = [&](std::size_t j) -> Vec3 { return now[j].center - now[j].start; };
      const auto growth = [&](std::size_t j) { return now[j].radius / now[j].start_radius; };
      branch.stations[k].center = now[k].start + move(k) / 2 + (move(k - 1) + move(k + 1)) / 4;
      branch.stations[k].radius =
          now[k].start_radius * (growth(k) / 2 + (growth(k - 1) + growth(k + 1)) / 4);
    }
  }
}

CenterlineTree moved_tree(const CenterlineTree& given, const std::vector<CaptureBranch>& branches,
                          const std::vector<std::vector<int>>& at_node, double& mean_move) {
  CenterlineTree tree = given;

  // Nodes first: the mean of what their branches' ends did.
  double sum = 0, count = 0;
  for (std::size_t n = 0; n < at_node.size(); ++n) {
    Vec3 move = Vec3::Zero();
    double ends = 0;
    for (const int b : at_node[n]) {
      const bool at_start = given.branches[index(b)].from == static_cast<int>(n);
      const std::vector<CaptureStation>& stations = branches[index(b)].stations;
      const CaptureStation& s = at_start ? stations.front() : stations.back();
      move += s.center - s.start;
      ends += 1;
    }
    if (ends > 0) tree.nodes[n].position_mm += move / ends;
  }

  // Then branches, which end in their nodes.
  for (std::size_t b = 0; b < branches.size(); ++b) {
    const std::vector<CaptureStation>& stations = branches[b].stations;
    CenterlineBranch& branch = tree.branches[b];
    const Eigen::Index n = static_cast<Eigen::Index>(stations.size());
    branch.points_mm.resize(3, n);
    branch.radii_mm.resize(n);
    for (Eigen::Index k = 0; k < n; ++k) {
      const CaptureStation& s = stations[index(k)];
      branch.points_mm.col(k) = s.center;
      branch.radii_mm(k) = s.radius;
      if (!s.clear) continue;
      sum += (s.center - s.start).norm();
      count += 1;
    }
    blend_to_node(branch, stations, tree.nodes[index(branch.from)].position_mm, false);
    blend_to_node(branch, stations, tree.nodes[index(branch.to)].position_mm, true);
  }
  mean_move = count > 0 ? sum / count : 0.0;
  return tree;
}

}  // namespace angiospline
