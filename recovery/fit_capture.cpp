#include "recovery/fit_capture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Geometry>
#include <tbb/parallel_for.h>

#include "base/median.h"
#include "modeling/smooth_centerlines.h"
#include "recovery/fit_axes.h"

namespace angiospline {
namespace {

constexpr int kAngles = 24;            // of a section, for grey levels and moments
constexpr int kFewestAngles = 16;      // of a section whose wall is measured
constexpr double kInsideRadii = 12.0;  // along a branch over which its levels are averaged
constexpr double kOutsideRadii = 6.0;  // the background may rise
constexpr double kStationRadii = 0.5;  // distance of sections, in radii ...
constexpr double kStationVox = 1.5;    // ... and at least in voxels
constexpr int kFewestStations = 4;
constexpr double kGoodEvidence = 0.6;  // of the contrast: the sections lie on the vessel
constexpr double kNoEvidence = 0.3;    // there is none
constexpr std::array<double, 5> kReaches{1.0, 1.5, 2.2, 3.3, 5.0};
constexpr double kEnoughContrast = 0.85;  // of the largest at any reach
constexpr double kLeastContrast = 0.3;    // of the noise around: less is no contrast
constexpr double kNormalScale = 1.4826;   // median absolute deviation to standard deviation
constexpr int kFewestClear = 3;  // stations of a branch that are measured, if need be near others
constexpr int kWideRounds = 6;
// Voxels on either side of the wall, in each narrow round.
constexpr std::array<double, 6> kWindows{2.0, 1.5, 1.0, 0.75, .5, .5};
constexpr int kNarrowRounds = static_cast<int>(kWindows.size());
constexpr int kNeighbours = 4;   // sections on either side that moments are averaged over
constexpr double kRimVox = 1.5;  // of an end that is not looked at

std::size_t at(Eigen::Index i) { return static_cast<std::size_t>(i); }

// A cross-section. Its frame is carried along the branch without turning.
struct Station {
  Vec3 center = Vec3::Zero();
  double radius = 1.0;
  double along = 0.0;
  Vec3 tangent = Vec3::Zero(), e1 = Vec3::Zero(), e2 = Vec3::Zero();
  bool clear = true;          // of other branches and of ends: it may be measured
  Vec3 start = Vec3::Zero();  // where it was to begin with
  double start_radius = 1.0;

  Vec3 direction(int k, int angles = kAngles) const {
    const double a = 2 * std::numbers::pi * k / angles;
    return std::cos(a) * e1 + std::sin(a) * e2;
  }
};

struct Section {
  Vec3 shift = Vec3::Zero();
  double growth = 0.0;
  bool measured = false;
};

struct Branch {
  std::vector<Station> stations;
  std::vector<WallLevels> levels;  // at each station
  double noise = 0.0;
  double evidence = 0.0;
};

void carry_frames(std::vector<Station>& stations) {
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

Branch sampled(const BSplineCurve<4>& path, double voxel) {
  const double length = path.knots().last() - path.knots().first();
  const double radius = path.at(path.knots().first() + length / 2)(3);
  const double step = std::max(kStationVox * voxel, kStationRadii * radius);
  const int count = std::max(kFewestStations, static_cast<int>(std::ceil(length / step)) + 1);
  Branch branch;
  for (int k = 0; k < count; ++k) {
    Station s;
    s.along = length * k / (count - 1);
    const Vec4 value = path.at(path.knots().first() + s.along);
    s.center = s.start = value.head<3>();
    s.radius = s.start_radius = value(3);
    branch.stations.push_back(s);
  }
  carry_frames(branch.stations);
  return branch;
}

class Capture {
 public:
  Capture(const SmoothedTree& smoothed, const GreyField& field, const Progress& progress)
      : tree_(smoothed.tree), field_(field), progress_(progress), voxel_(field.voxel_mm()) {
    for (const BSplineCurve<4>& path : smoothed.paths) branches_.push_back(sampled(path, voxel_));
    at_node_ = branches_at_nodes(tree_);
    find_clear();
  }

  Result<CapturedTree> run() {
    CapturedTree result;
    for (std::size_t b = 0; b < branches_.size(); ++b) measure_levels(branches_[b]);
    share_levels();
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
    for (std::size_t b = 0; b < branches_.size(); ++b) {
      if (branches_[b].evidence >= kNoEvidence) continue;
      result.left_alone.push_back(tree_.branches[b].name);
      for (Station& s : branches_[b].stations) {
        s.center = s.start;
        s.radius = s.start_radius;
      }
    }
    result.tree = moved_tree(result.mean_move_mm);
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
      for (const double share : {1.0, 0.7, 0.5, 0.35}) {
        std::vector<Station>& stations = branches_[b].stations;
        for (Station& s : stations) s.clear = is_clear(s, static_cast<int>(b), share);
        clear = std::count_if(stations.begin(), stations.end(),
                              [](const Station& s) { return s.clear; });
        if (clear >= kFewestClear) break;
      }
    }
  }

  // Radii count by `share`.
  bool is_clear(const Station& s, int branch, double share) const {
    const CenterlineBranch& own = tree_.branches[at(branch)];
    for (const int n : {own.from, own.to}) {
      const double away = (s.center - tree_.nodes[at(n)].position_mm).norm();
      if (at_node_[at(n)].size() == 1) {
        const Vec3 node = tree_.nodes[at(n)].position_mm;
        if ((s.start - node).norm() < kRimVox * voxel_) return false;
        continue;
      }
      if (away < share * s.radius) return false;
      for (const int other : at_node_[at(n)]) {
        if (other == branch || away > 8 * s.radius) continue;
        for (const Station& o : branches_[at(other)].stations) {
          if ((s.center - o.center).norm() < share * (s.radius + o.radius) + voxel_) return false;
        }
      }
    }
    return true;
  }

  double mean_on_ring(const Station& s, double radius) const {
    double sum = 0;
    int count = 0;
    for (int k = 0; k < kAngles; ++k) {
      const Vec3 p = s.center + radius * s.direction(k);
      if (!field_.covers(p)) continue;
      sum += field_.at(p);
      ++count;
    }
    return count > 0 ? sum / count : std::numeric_limits<double>::quiet_NaN();
  }

  double inside_of(const Station& s) const {
    const double room = s.radius - 1.5 * voxel_;
    const double reach = room > 0.3 * s.radius ? room : 0.3 * s.radius;
    return (mean_on_ring(s, 0) + 3 * mean_on_ring(s, 0.5 * reach) + 4 * mean_on_ring(s, reach)) / 8;
  }
  // The lower half of what lies around: another vessel beside it does not count.
  double outside_of(const Station& s) const {
    std::vector<double> greys;
    for (const double beyond : {1.7, 2.5, 3.3}) {
      for (int k = 0; k < kAngles; ++k) {
        const Vec3 p = s.center + (s.radius + beyond * voxel_) * s.direction(k);
        if (field_.covers(p)) greys.push_back(field_.at(p));
      }
    }
    return greys.empty() ? std::numeric_limits<double>::quiet_NaN() : median(std::move(greys));
  }

  // Levels at each station, averaged along the branch; contrast is what the tree has together.
  void measure_levels(Branch& branch) const {
    const std::size_t n = branch.stations.size();
    std::vector<double> in(n), out(n);
    for (std::size_t k = 0; k < n; ++k) {
      in[k] = inside_of(branch.stations[k]);
      out[k] = outside_of(branch.stations[k]);
    }
    branch.levels.assign(n, {});
    const double spacing =
        (branch.stations.back().along - branch.stations.front().along) / static_cast<double>(n - 1);
    const double radius = branch.stations[n / 2].radius;
    const auto within = [&](double radii) {
      return static_cast<std::size_t>(std::ceil(radii * radius / spacing));
    };
    const std::size_t reach_in = within(kInsideRadii), reach_out = within(kOutsideRadii);
    for (std::size_t k = 0; k < n; ++k) {
      branch.levels[k].inside = mean_around(branch, in, k, reach_in);
      branch.levels[k].outside = mean_around(branch, out, k, reach_out);
    }
  }

  // Over the measured stations within `reach` of station k, and itself.
  static double mean_around(const Branch& branch, const std::vector<double>& values, std::size_t k,
                            std::size_t reach) {
    double sum = 0, count = 0;
    for (std::size_t j = k > reach ? k - reach : 0; j <= std::min(values.size() - 1, k + reach);
         ++j) {
      if ((!branch.stations[j].clear && j != k) || !std::isfinite(values[j])) continue;
      sum += values[j];
      count += 1;
    }
    return sum / count;
  }

  // Deviation of the greys around the stations from their medians: noise, and what else is there.
  double noise_around() const {
    std::vector<double> deviations;
    for (const Branch& branch : branches_) {
      for (const Station& s : branch.stations) {
        std::vector<double> greys;
        for (int k = 0; k < kAngles; ++k) {
          const Vec3 p = s.center + (s.radius + 2.5 * voxel_) * s.direction(k);
          if (field_.covers(p)) greys.push_back(field_.at(p));
        }
        const double middle = median(greys);
        for (const double grey : greys) deviations.push_back(std::abs(grey - middle));
      }
    }
    return kNormalScale * median(std::move(deviations));
  }

  // Of all stations together: the brighter ones' inside, the middle one's outside.
  WallLevels levels_of_stations() const {
    std::vector<double> in, out;
    for (const Branch& branch : branches_) {
      for (std::size_t k = 0; k < branch.levels.size(); ++k) {
        if (!branch.stations[k].clear) continue;
        if (std::isfinite(branch.levels[k].inside)) in.push_back(branch.levels[k].inside);
        if (std::isfinite(branch.levels[k].outside)) out.push_back(branch.levels[k].outside);
      }
    }
    std::sort(in.begin(), in.end());
    return {in.empty() ? 0.0 : in[in.size() * 3 / 4], median(out)};
  }

  // The tree's levels, and how far each branch's own reach towards them.
  void share_levels() {
    common_ = levels_of_stations();
    bool lost = !(common_.contrast() > kLeastContrast * noise_around());
    for (Branch& branch : branches_) set_evidence(branch);
    std::vector<double> all;
    for (const Branch& branch : branches_) all.push_back(branch.evidence);
    lost = lost || median(all) < kGoodEvidence;
    if (lost) look_around();
    for (Branch& branch : branches_) {
      fill_levels(branch);
      set_evidence(branch);
    }
  }

  void fill_levels(Branch& branch) const {
    for (WallLevels& l : branch.levels) {
      const bool sound = std::isfinite(l.inside) && std::isfinite(l.outside) &&
                         l.contrast() > kNoEvidence * common_.contrast();
      if (!sound) l = common_;
    }
  }

  // For a tree that lies beside its vessels, or wholly inside them: two means of grey in discs
  // around all stations, the smallest discs in which they differ about as much as in any.
  void look_around() {
    std::vector<WallLevels> found;
    double most = 0;
    for (const double reach : kReaches) {
      reach_ = reach;
      found.push_back(two_levels());
      most = std::max(most, found.back().contrast());
    }
    std::size_t k = 0;
    while (found[k].contrast() < kEnoughContrast * most) ++k;
    reach_ = kReaches[k];
    common_ = found[k];
  }

  // Means of the brighter and the darker part of all discs; no contrast if either has less than
  // 2 % of them.
  WallLevels two_levels() const {
    std::vector<double> greys;
    for (const Branch& branch : branches_) {
      for (std::size_t k = 0; k < branch.stations.size(); ++k) {
        for (const Disc::Cell& cell : disc_at(branch, k, reach_).cells) greys.push_back(cell.grey);
      }
    }
    if (greys.empty()) return {0.0, 0.0};
    std::sort(greys.begin(), greys.end());
    std::vector<double> sums{0.0};
    for (const double grey : greys) sums.push_back(sums.back() + grey);
    const auto mean = [&](std::size_t from, std::size_t to) {
      return to > from ? (sums[to] - sums[from]) / static_cast<double>(to - from)
                       : greys[std::min(from, greys.size() - 1)];
    };
    std::size_t cut = greys.size() / 2;
    for (int k = 0; k < 50; ++k) {
      const double threshold = (mean(0, cut) + mean(cut, greys.size())) / 2;
      cut = static_cast<std::size_t>(std::lower_bound(greys.begin(), greys.end(), threshold) -
                                     greys.begin());
    }
    const std::size_t fewest = greys.size() / 50;
    if (cut < fewest || cut > greys.size() - fewest) return {0.0, 0.0};
    return {mean(cut, greys.size()), mean(0, cut)};
  }

  // Grey around a station, averaged over its neighbours.
  struct Disc {
    struct Cell {
      Vec2 at;
      double grey;
    };
    std::vector<Cell> cells;
    double cell_area = 1.0;
    double radius = 0.0;
  };
  // `reach` widens it, in multiples of what the branch started with.
  Disc disc_at(const Branch& branch, std::size_t k, double reach) const {
    const Station& s = branch.stations[k];
    Disc disc;
    disc.radius =
        std::max(1.5 * s.radius + 3 * voxel_, reach * (1.5 * s.start_radius + 3 * voxel_));
    const double step = std::max(voxel_, disc.radius / 10);
    disc.cell_area = step * step;
    const int cells = static_cast<int>(disc.radius / step);
    const std::size_t from = k > kNeighbours ? k - kNeighbours : 0;
    const std::size_t to = std::min(branch.stations.size() - 1, k + kNeighbours);
    for (int i = -cells; i <= cells; ++i) {
      for (int j = -cells; j <= cells; ++j) {
        const Vec2 place = step * Vec2(i, j);
        if (place.norm() > disc.radius) continue;
        double sum = 0;
        int count = 0;
        for (std::size_t n = from; n <= to; ++n) {
          const Station& o = branch.stations[n];
          const Vec3 p = o.center + place.x() * o.e1 + place.y() * o.e2;
          if (!o.clear || !field_.covers(p)) continue;
          sum += field_.at(p);
          ++count;
        }
        if (count > 0) disc.cells.push_back({place, sum / count});
      }
    }
    return disc;
  }

  // Leads branches that do not lie on their vessels there; those that it found.
  std::vector<std::size_t> lead_to_vessels() {
    std::vector<std::size_t> lost;
    for (std::size_t b = 0; b < branches_.size(); ++b) {
      if (branches_[b].evidence < kGoodEvidence) lost.push_back(b);
    }
    if (lost.empty() || !(common_.contrast() > 0)) return {};
    const std::vector<Branch> before = branches_;
    for (int round = 0; round < kWideRounds && !progress_.should_stop(); ++round) {
      tbb::parallel_for(std::size_t{0}, lost.size(),
                        [&](std::size_t k) { wide_round(branches_[lost[k]], round); });
      find_clear();  // radii are others now
      // What was taken for background may have been half vessel; nearer to the wall it is not.
      for (Branch& branch : branches_) measure_levels(branch);
      const WallLevels nearer = levels_of_stations();
      if (nearer.contrast() > common_.contrast()) common_ = nearer;
    }
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
    for (Branch& branch : branches_) measure_again(branch);
    return found;
  }

  void measure_again(Branch& branch) const {
    measure_levels(branch);
    fill_levels(branch);
    set_evidence(branch);
  }

  // Moves a branch by the moments of what is bright around it.
  void wide_round(Branch& branch, int round) const {
    const Branch now = branch;
    for (std::size_t k = 0; k < now.stations.size(); ++k) {
      if (!now.stations[k].clear) continue;
      const Disc disc = disc_at(now, k, 2 * round < kWideRounds ? reach_ : 1.0);
      double area = 0;
      Vec2 moment = Vec2::Zero();
      for (const Disc::Cell& cell : disc.cells) {
        const double f = (cell.grey - common_.outside) / common_.contrast();
        area += f * disc.cell_area;
        moment += f * disc.cell_area * cell.at;
      }
      Station& s = branch.stations[k];
      if (area < 0.05 * std::numbers::pi * disc.radius * disc.radius) continue;
      Vec2 shift = moment / area;
      const double most = disc.radius / 2;
      if (shift.norm() > most) shift *= most / shift.norm();
      s.center += shift.x() * s.e1 + shift.y() * s.e2;
      s.radius = std::clamp(std::sqrt(area / std::numbers::pi), 0.6 * s.radius, 1.7 * s.radius);
    }
    follow(branch);
    smooth_moves(branch, 2);
    carry_frames(branch.stations);
  }

  void set_evidence(Branch& branch) const {
    std::vector<double> steps;
    for (const Station& s : branch.stations) {
      if (!s.clear) continue;
      const double in = mean_on_ring(s, std::max(0.3 * s.radius, s.radius - voxel_));
      const double out = mean_on_ring(s, s.radius + voxel_);
      if (std::isfinite(in) && std::isfinite(out)) steps.push_back((in - out) / common_.contrast());
    }
    // A branch without room to measure is led by its neighbours.
    double sum = 0;
    for (const double step : steps) sum += step;
    branch.evidence = steps.empty() ? 1.0 : sum / static_cast<double>(steps.size());
  }

  // The station as it would be at a fraction in [-1/2, 1/2] of the way to its neighbours.
  static Station between(const std::vector<Station>& stations, std::size_t k, double fraction) {
    Station s = stations[k];
    const std::size_t other =
        fraction < 0 ? (k > 0 ? k - 1 : k) : std::min(k + 1, stations.size() - 1);
    const double w = std::abs(fraction);
    s.center += w * (stations[other].center - s.center);
    s.radius += w * (stations[other].radius - s.radius);
    return s;
  }

  // The wall's mean offset and first harmonic over the stretch of branch that the station stands
  // for: about one profile a voxel, so that all of the image's wall is used.
  Section measure(const Branch& branch, std::size_t k, double half_window_vox) const {
    const std::vector<Station>& stations = branch.stations;
    const double spacing =
        (stations.back().along - stations.front().along) / static_cast<double>(stations.size() - 1);
    const int slices = std::max(1, static_cast<int>(std::lround(spacing / voxel_)));
    const int angles =
        std::max(kFewestAngles,
                 static_cast<int>(std::lround(2 * std::numbers::pi * stations[k].radius / voxel_)));
    Section section;
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    Vec3 b = Vec3::Zero();
    int count = 0;
    for (int j = 0; j < slices; ++j) {
      const Station s = between(stations, k, (j + 0.5) / slices - 0.5);
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
    if (4 * count < 3 * slices * angles) return section;
    const Vec3 x = A.ldlt().solve(b);
    section.growth = x(0);
    section.shift = x(1) * stations[k].e1 + x(2) * stations[k].e2;
    section.measured = true;
    return section;
  }

  void narrow_round(Branch& branch, int round, bool last) const {
    if (branch.evidence < kNoEvidence) return;
    measure_levels(branch);
    fill_levels(branch);
    const double half = kWindows[at(round)];
    const Branch now = branch;
    for (std::size_t k = 0; k < now.stations.size(); ++k) {
      Station& s = branch.stations[k];
      if (!s.clear) continue;
      const Section section = measure(now, k, half);
      if (!section.measured) continue;
      const double most = std::max(0.5 * s.radius, voxel_);
      const double length = section.shift.norm();
      s.center += std::min(1.0, most / std::max(length, 1e-300)) * section.shift;
      s.radius = std::clamp(s.radius + section.growth, 0.6 * s.radius, 1.7 * s.radius);
    }
    follow(branch);
    if (!last) smooth_moves(branch, 1);
    carry_frames(branch.stations);
    if (last) set_evidence(branch);
  }

  // Puts measured stations on smooth axes; the others follow.
  void straighten() {
    std::vector<AxisSections> sections;
    for (const Branch& branch : branches_) {
      const auto n = static_cast<Eigen::Index>(branch.stations.size());
      AxisSections s{Points3(3, n), Eigen::VectorXd(n), {}, branch.stations[at(n / 2)].radius};
      for (Eigen::Index k = 0; k < n; ++k) {
        const Station& station = branch.stations[at(k)];
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
      follow(branches_[b]);
    }
  }

  // Stations that are not measured move as the nearest measured one does.
  static void follow(Branch& branch) {
    std::vector<std::size_t> clear;
    for (std::size_t k = 0; k < branch.stations.size(); ++k) {
      if (branch.stations[k].clear) clear.push_back(k);
    }
    if (clear.empty()) return;
    for (std::size_t k = 0; k < branch.stations.size(); ++k) {
      Station& s = branch.stations[k];
      if (s.clear) continue;
      const auto after = std::lower_bound(clear.begin(), clear.end(), k);
      const std::size_t nearest = after == clear.begin() ? clear.front()
                                  : *(after - 1) < k     ? *(after - 1)
                                                         : *after;
      const std::size_t other = after == clear.end() ? clear.back() : *after;
      const std::size_t from =
          other > k && (nearest > k || other - k < k - nearest) ? other : nearest;
      const Station& guide = branch.stations[from];
      Vec3 move = guide.center - guide.start;
      move -= move.dot(s.tangent) * s.tangent;
      s.center = s.start + move;
      s.radius = s.start_radius * guide.radius / guide.start_radius;
    }
  }

  // Quarter, half, quarter averages of the moves along the branch.
  static void smooth_moves(Branch& branch, int passes) {
    const std::size_t n = branch.stations.size();
    for (int pass = 0; pass < passes; ++pass) {
      const std::vector<Station> now = branch.stations;
      for (std::size_t k = 1; k + 1 < n; ++k) {
        const auto move = [&](std::size_t j) -> Vec3 { return now[j].center - now[j].start; };
        const auto growth = [&](std::size_t j) { return now[j].radius / now[j].start_radius; };
        branch.stations[k].center = now[k].start + move(k) / 2 + (move(k - 1) + move(k + 1)) / 4;
        branch.stations[k].radius =
            now[k].start_radius * (growth(k) / 2 + (growth(k - 1) + growth(k + 1)) / 4);
      }
    }
  }

  // Nodes move as the nearest measured stations of their branches do, in the mean; between a
  // junction and its first measured station the move goes over from the one to the other.
  CenterlineTree moved_tree(double& mean_move) const {
    CenterlineTree tree = tree_;
    double sum = 0, count = 0;
    for (std::size_t n = 0; n < at_node_.size(); ++n) {
      Vec3 move = Vec3::Zero();
      double ends = 0;
      for (const int b : at_node_[n]) {
        const bool at_start = tree_.branches[at(b)].from == static_cast<int>(n);
        const std::vector<Station>& stations = branches_[at(b)].stations;
        const Station& s = at_start ? stations.front() : stations.back();
        move += s.center - s.start;
        ends += 1;
      }
      if (ends > 0) tree.nodes[n].position_mm += move / ends;
    }
    for (std::size_t b = 0; b < branches_.size(); ++b) {
      const std::vector<Station>& stations = branches_[b].stations;
      CenterlineBranch& branch = tree.branches[b];
      const Eigen::Index n = static_cast<Eigen::Index>(stations.size());
      branch.points_mm.resize(3, n);
      branch.radii_mm.resize(n);
      for (Eigen::Index k = 0; k < n; ++k) {
        const Station& s = stations[at(k)];
        branch.points_mm.col(k) = s.center;
        branch.radii_mm(k) = s.radius;
        if (!s.clear) continue;
        sum += (s.center - s.start).norm();
        count += 1;
      }
      blend_to_node(branch, stations, tree.nodes[at(branch.from)].position_mm, false);
      blend_to_node(branch, stations, tree.nodes[at(branch.to)].position_mm, true);
    }
    mean_move = count > 0 ? sum / count : 0.0;
    return tree;
  }

  static void blend_to_node(CenterlineBranch& branch, const std::vector<Station>& stations,
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

  CenterlineTree tree_;
  const GreyField& field_;
  const Progress& progress_;
  double voxel_;
  std::vector<Branch> branches_;
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
