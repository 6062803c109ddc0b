#include "recovery/capture/capture.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <tbb/parallel_for.h>

#include "base/index.h"
#include "base/median.h"
#include "modeling/tree/smooth_centerlines.h"
#include "recovery/capture/axes.h"
#include "recovery/capture/greys.h"
#include "recovery/capture/levels.h"
#include "recovery/capture/rules.h"
#include "recovery/capture/stations.h"

namespace angiospline {
namespace {

using namespace capture_rules;

struct Section {
  Vec3 shift = Vec3::Zero();
  double growth = 0.0;
  bool measured = false;
};

class Capture {
 public:
  Capture(const SmoothedTree& smoothed, const GreyField& field, const Progress& progress)
      : tree_(smoothed.tree), field_(field), progress_(progress), voxel_(field.voxel_mm()) {
    for (const BSplineCurve<4>& path : smoothed.paths)
      branches_.push_back(sampled_branch(path, voxel_));
    at_node_ = branches_at_nodes(tree_);
    find_clear();
  }

  Result<CapturedTree> run() {
    CapturedTree result;
    for (std::size_t b = 0; b < branches_.size(); ++b) measure_levels(field_, branches_[b]);
    share_levels();

    // From far off first, then by the wall itself in windows that become narrower.
    const std::vector<std::size_t> led = lead_to_vessels();
    for (const std::size_t b : led) result.recaptured.push_back(tree_.branches[b].name);
    for (int round = 0; round < kNarrowRounds; ++round) {
      if (progress_.should_stop()) return fail(cancelled("capture"));
      progress_.at("capture", static_cast<double>(round) / kNarrowRounds);
      const bool last = round + 1 == kNarrowRounds;
      tbb::parallel_for(std::size_t{0}, branches_.size(),
                        [&](std::size_t b) { narrow_round(branches_[b], round, last); });
    }
    straighten();

    // Branches that no wall was found for are as they were.
    for (std::size_t b = 0; b < branches_.size(); ++b) {
      if (branches_[b].evidence >= kNoEvidence) continue;
      result.left_alone.push_back(tree_.branches[b].name);
      for (CaptureStation& s : branches_[b].stations) {
        s.center = s.start;
        s.radius = s.start_radius;
      }
    }

    result.tree = moved_tree(tree_, branches_, at_node_, result.mean_move_mm);
    result.rounds = kNarrowRounds + (result.recaptured.empty() ? 0 : kWideRounds);
    return result;
  }

 private:
  // Stations that another branch of their junction, or an open end, comes near to are not clear. A
  // start that is too thick may have none that are: then those count that are clear of thinner
  // vessels.
  void find_clear() {
    for (std::size_t b = 0; b < branches_.size(); ++b) {
      std::ptrdiff_t clear = 0;
      for (const double share : kClearShares) {
        std::vector<CaptureStation>& stations = branches_[b].stations;
        for (CaptureStation& s : stations) s.clear = is_clear(s, static_cast<int>(b), share);
        clear = std::count_if(stations.begin(), stations.end(),
                              [](const CaptureStation& s) { return s.clear; });
        if (clear >= kFewestClear) break;
      }
    }
  }

  // Radii count by `share`.
  bool is_clear(const CaptureStation& s, int branch, double share) const {
    const CenterlineBranch& own = tree_.branches[index(branch)];
    for (const int n : {own.from, own.to}) {
      const double away = (s.center - tree_.nodes[index(n)].position_mm).norm();
      if (at_node_[index(n)].size() == 1) {
        const Vec3 node = tree_.nodes[index(n)].position_mm;
        if ((s.start - node).norm() < kRimVox * voxel_) return false;
        continue;
      }

      if (away < share * s.radius) return false;
      for (const int other : at_node_[index(n)]) {
        if (other == branch || away > kNearJunction * s.radius) continue;
        for (const CaptureStation& o : branches_[index(other)].stations) {
          if ((s.center - o.center).norm() < share * (s.radius + o.radius) + voxel_) return false;
        }
      }
    }
    return true;
  }

  // The tree's levels, and how far each branch's own reach towards them.
  void share_levels() {
    common_ = levels_of_stations(branches_);
    bool lost = !(common_.contrast() > kLeastContrast * noise_around(field_, branches_));
    for (CaptureBranch& branch : branches_) set_evidence(field_, common_, branch);

    std::vector<double> all;
    for (const CaptureBranch& branch : branches_) all.push_back(branch.evidence);
    lost = lost || median(all) < kGoodEvidence;

    if (lost) {
      const DiscLevels around = look_around(field_, branches_);
      common_ = around.levels;
      reach_ = around.reach;
    }

    for (CaptureBranch& branch : branches_) {
      fill_levels(common_, branch);
      set_evidence(field_, common_, branch);
    }
  }

  // Leads branches that do not lie on their vessels there; those that it found.
  std::vector<std::size_t> lead_to_vessels() {
    std::vector<std::size_t> lost;
    for (std::size_t b = 0; b < branches_.size(); ++b) {
      if (branches_[b].evidence < kGoodEvidence) lost.push_back(b);
    }
    if (lost.empty() || !(common_.contrast() > 0)) return {};

    const std::vector<CaptureBranch> before = branches_;
    for (int round = 0; round < kWideRounds && !progress_.should_stop(); ++round) {
      tbb::parallel_for(std::size_t{0}, lost.size(),
                        [&](std::size_t k) { wide_round(branches_[lost[k]], round); });
      find_clear();  // radii are others now
      // What was taken for background may have been half vessel; nearer to the wall it is not.
      for (CaptureBranch& branch : branches_) measure_levels(field_, branch);
      const WallLevels nearer = levels_of_stations(branches_);
      if (nearer.contrast() > common_.contrast()) common_ = nearer;
    }

    // Those that still lie on nothing go back to where they were.
    std::vector<std::size_t> found;
    for (const std::size_t b : lost) {
      measure_again(branches_[b]);
      if (branches_[b].evidence >= kNoEvidence) {
        found.push_back(b);
      } else {
        branches_[b].stations = before[b].stations;
      }
    }
    find_clear();
    for (CaptureBranch& branch : branches_) measure_again(branch);
    return found;
  }

  void measure_again(CaptureBranch& branch) const {
    measure_levels(field_, branch);
    fill_levels(common_, branch);
    set_evidence(field_, common_, branch);
  }

  // Moves a branch by the moments of what is bright around it.
  void wide_round(CaptureBranch& branch, int round) const {
    const CaptureBranch now = branch;
    for (std::size_t k = 0; k < now.stations.size(); ++k) {
      if (!now.stations[k].clear) continue;
      const Disc disc = disc_at(field_, now, k, 2 * round < kWideRounds ? reach_ : 1.0);

      // Moments of what is bright: f is 1 in the vessel and 0 beside it.
      double area = 0;
      Vec2 moment = Vec2::Zero();
      for (const Disc::Cell& cell : disc.cells) {
        const double f = (cell.grey - common_.outside) / common_.contrast();
        area += f * disc.cell_area;
        moment += f * disc.cell_area * cell.at;
      }

      CaptureStation& s = branch.stations[k];
      if (area < kLeastArea * std::numbers::pi * disc.radius * disc.radius) continue;
      Vec2 shift = moment / area;
      const double most = disc.radius / 2;
      if (shift.norm() > most) shift *= most / shift.norm();
      s.center += shift.x() * s.e1 + shift.y() * s.e2;
      s.radius = std::clamp(std::sqrt(area / std::numbers::pi), kLeastGrowth * s.radius,
                            kMostGrowth * s.radius);
    }

    follow_clear(branch);
    smooth_moves(branch, 2);
    carry_frames(branch.stations);
  }

  // The wall's mean offset and first harmonic over the stretch of branch that the station stands
  // for: about one profile a voxel, so that all of the image's wall is used.
  Section measure(const CaptureBranch& branch, std::size_t k, double half_window_vox) const {
    const std::vector<CaptureStation>& stations = branch.stations;
    const double spacing =
        (stations.back().along - stations.front().along) / static_cast<double>(stations.size() - 1);
    const int slices = std::max(1, static_cast<int>(std::lround(spacing / voxel_)));
    const int angles =
        std::max(kFewestAngles,
                 static_cast<int>(std::lround(2 * std::numbers::pi * stations[k].radius / voxel_)));

    // Offsets d(phi) = growth + shift . n(phi), by least squares over all profiles.
    Section section;
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    Vec3 b = Vec3::Zero();
    int count = 0;
    for (int j = 0; j < slices; ++j) {
      const CaptureStation s = between(stations, k, (j + 0.5) / slices - 0.5);
      for (int a = 0; a < angles; ++a) {
        const Vec3 n = s.direction(a, angles);
        const WallPoint p{s.center + s.radius * n, n, 1 / s.radius, 0.0};
        const WallOffset offset =
            wall_offset(field_, p, branch.levels[k], {half_window_vox, branch.noise});
        if (!offset.measured) continue;
        const Vec3 row(1, n.dot(s.e1), n.dot(s.e2));
        A += row * row.transpose();
        b += offset.offset_mm * row;
        ++count;
      }
    }

    // The circle has to be known nearly all round.
    if (4 * count < 3 * slices * angles) return section;
    const Vec3 x = A.ldlt().solve(b);
    section.growth = x(0);
    section.shift = x(1) * stations[k].e1 + x(2) * stations[k].e2;
    section.measured = true;
    return section;
  }

  void narrow_round(CaptureBranch& branch, int round, bool last) const {
    if (branch.evidence < kNoEvidence) return;
    measure_levels(field_, branch);
    fill_levels(common_, branch);
    const double half = kWindows[index(round)];

    // All sections are measured where they were, so that the order does not count.
    const CaptureBranch now = branch;
    for (std::size_t k = 0; k < now.stations.size(); ++k) {
      CaptureStation& s = branch.stations[k];
      if (!s.clear) continue;
      const Section section = measure(now, k, half);
      if (!section.measured) continue;
      const double most = std::max(0.5 * s.radius, voxel_);
      const double length = section.shift.norm();
      s.center += std::min(1.0, most / std::max(length, 1e-300)) * section.shift;
      s.radius =
          std::clamp(s.radius + section.growth, kLeastGrowth * s.radius, kMostGrowth * s.radius);
    }

    follow_clear(branch);
    if (!last) smooth_moves(branch, 1);
    carry_frames(branch.stations);
    if (last) set_evidence(field_, common_, branch);
  }

  // Puts measured stations on smooth axes; the others follow.
  void straighten() {
    std::vector<AxisSections> sections;
    for (const CaptureBranch& branch : branches_) {
      const auto n = static_cast<Eigen::Index>(branch.stations.size());
      AxisSections s{Points3(3, n), Eigen::VectorXd(n), {}, branch.stations[index(n / 2)].radius};
      for (Eigen::Index k = 0; k < n; ++k) {
        const CaptureStation& station = branch.stations[index(k)];
        s.centers_mm.col(k) = station.center;
        s.along_mm(k) = station.along;
        s.measured.push_back(station.clear && branch.evidence >= kNoEvidence);
      }
      sections.push_back(std::move(s));
    }

    const std::vector<Points3> smooth = smooth_axes(sections);
    for (std::size_t b = 0; b < branches_.size(); ++b) {
      for (std::size_t k = 0; k < branches_[b].stations.size(); ++k) {
        if (!sections[b].measured[k]) continue;
        branches_[b].stations[k].center = smooth[b].col(static_cast<Eigen::Index>(k));
      }
      follow_clear(branches_[b]);
    }
  }

  CenterlineTree tree_;
  const GreyField& field_;
  const Progress& progress_;
  double voxel_;
  std::vector<CaptureBranch> branches_;
  std::vector<std::vector<int>> at_node_;
  WallLevels common_;
  double reach_ = 1.0;  // of the discs that a lost tree is led by, in multiples of their size
};

}  // namespace

Result<CapturedTree> capture_tree(const CenterlineTree& tree, const GreyField& field,
                                  const Progress& progress) {
  const auto smoothed = smooth_centerlines(tree, {}, progress);
  if (!smoothed) return fail(smoothed.error());
  return Capture(*smoothed, field, progress).run();
}

}  // namespace angiospline
