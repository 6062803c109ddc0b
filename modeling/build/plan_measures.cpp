// Where the openings of one junction lie, and what that asks of the bodies behind them.
#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>

#include "base/index.h"
#include "modeling/body/path.h"
#include "modeling/build/plan.h"

namespace angiospline {
namespace {

constexpr double kLeastMargin = 0.3;  // of an opening beyond the blend, in radii
constexpr double kLeastBlend = 0.4;   // of the blend asked for
constexpr double kMergedOffset =
    0.2;  // branches that begin so far from their node were moved to it
constexpr double kPartingRadii = 0.5;  // from where they began to where they are aimed at, at first
// From so many branches of a merged node on their rays begin where they do: seen from the centre
// they part only far out.
constexpr std::size_t kManyBranches = 6;
constexpr int kDirectionRounds = 16;
constexpr int kMostRefused = 8;
constexpr int kDamped = 3;    // from this round on steps are halved,
constexpr int kBisected = 5;  // from this one distances are looked for between too near and enough
constexpr double kSettled = 0.02;    // radii
constexpr double kOnItsPath = 0.25;  // radii between an opening and its branch that are no strain
constexpr double kAllowedSag = 0.4;  // radii between a branch and the chord it is taken for
constexpr double kSagStrain = 0.5;   // of a radius more, in radians
constexpr double kBendStep = 0.25;   // radii between places at which bends are measured,
constexpr double kBendReach = 4.0;   // and how far behind the opening
constexpr double kBendStrain = 1.0;  // of curvature times radius beyond kTightestBend
constexpr double kOverlapStrain = 0.6;  // of two branches that still overlap behind their openings
constexpr double kLookedAhead = 8.0;    // radii behind the openings
constexpr double kUnmeasured = 10.0;    // strain where no openings can be found
constexpr double kStrained = 0.6;       // radians that are worth looking for something better
constexpr double kMoveStrain = 0.04;    // of a centre moved by a radius
constexpr double kWorthMoving = 0.15;
constexpr double kSharedAngle = 1.0;     // radians between branches that may share their first part
constexpr int kSharedRadii = 8;          // of it that the centre may move along
constexpr double kMostOfABranch = 0.45;  // that a junction may take

}  // namespace

// Every branch's direction: to where its path comes to `distance` from the centre.
void Plan::aim(PlannedNode& node, const std::vector<double>& distance) const {
  for (std::size_t k = 0; k < node.ends.size(); ++k) {
    const BranchEnd end = node.ends[k];
    const PlannedBranch& branch = branches_[index(end.branch)];
    const double meets = std::max(node.meets_mm[k], node.reach * distance[k]);
    const double s =
        branch.along_at_distance(end, node.center_mm, meets).value_or(branch.length_mm());
    Vec4 target = branch.at(end.at_end ? branch.length_mm() - s : s);
    const double radius = target(3);
    if (branch.straight) target.head<3>() = node_at({end.branch, !end.at_end}).center_mm;
    if (node.bent_at[k] > 0 && !branch.straight) {
      const double begins = node.bent_at[k] * s;
      node.begins_mm[k] =
          branch.at(end.at_end ? branch.length_mm() - begins : begins).head<3>() - node.center_mm;
    }
    const Vec3 chord = target.head<3>() - node.center_mm - node.begins_mm[k];
    node.spec.branches[k] = {branch.name, chord.normalized(), radius, 0.0, node.begins_mm[k]};
  }
}

// Directions are those from the centre to the openings' centres on the paths, whose distances
// depend on the directions: a fixed point, found by repetition from the nearest possible openings
// outward. Where a path turns, distances that are too near and ones that are far enough may follow
// each other without end: then the boundary is bisected, and the far side of it taken. False if
// the directions of the last round allow no openings.
bool Plan::find_distances(PlannedNode& node, std::vector<double>& distance) const {
  const std::size_t n = node.ends.size();
  std::vector<double> too_near(n, 0.0);
  std::vector<double> enough(n, std::numeric_limits<double>::infinity());
  int refused = 0;
  for (int round = 0; round < kDirectionRounds; ++round) {
    aim(node, distance);
    const auto next = opening_distances_mm(node.spec, options_);
    if (!next) {
      // Branches that leave together part farther out.
      node.error = next.error();
      if (++refused > kMostRefused) return false;
      for (std::size_t k = 0; k < n; ++k) {
        too_near[k] = std::max(too_near[k], distance[k]);
        distance[k] *= 1.5;
        if (node.meets_mm[k] > 0) node.meets_mm[k] += 0.5 * node.spec.branches[k].radius_mm;
      }
      continue;
    }
    node.error.reset();
    double change = 0;
    for (std::size_t k = 0; k < n; ++k) {
      const double needed = std::min((*next)[k], node.caps_mm[k]);
      if (needed > distance[k]) {
        too_near[k] = std::max(too_near[k], distance[k]);
      } else {
        enough[k] = std::min(enough[k], distance[k]);
      }
      const bool bracketed = too_near[k] < enough[k] && std::isfinite(enough[k]);
      const double to = round < kDamped                   ? needed
                        : round >= kBisected && bracketed ? (too_near[k] + enough[k]) / 2
                                                          : (needed + distance[k]) / 2;
      change = std::max(change, std::abs(to - distance[k]) / node.spec.branches[k].radius_mm);
      distance[k] = to;
    }
    if (change < kSettled) break;
  }
  if (node.error) return false;
  for (std::size_t k = 0; k < n; ++k) {
    const double step = enough[k] - distance[k];
    if (step > 0 && step < node.spec.branches[k].radius_mm) distance[k] = enough[k];
  }
  return true;
}

void Plan::measure(PlannedNode& node) const {
  const std::size_t n = node.ends.size();
  std::vector<double> distance(n);
  node.spec.center_mm = node.center_mm;
  node.spec.branches.assign(n, {});
  node.meets_mm.assign(n, 0.0);
  node.begins_mm.assign(n, Vec3::Zero());
  node.caps_mm.resize(n, std::numeric_limits<double>::infinity());
  node.farther_mm.resize(n, 0.0);
  node.bent_at.resize(n, 0.0);
  node.error.reset();
  for (std::size_t k = 0; k < n; ++k) {
    const BranchEnd end = node.ends[k];
    const PlannedBranch& branch = branches_[index(end.branch)];
    const double passing = branch.along_nearest(end, node.center_mm);
    const Vec4 first = branch.at(end.at_end ? branch.length_mm() - passing : passing);
    distance[k] = first(3);
    node.meets_mm[k] = node.farther_mm[k];
    // Branches of a merged node may begin away from its centre: they part beyond where they begin.
    const double away = (first.head<3>() - node.center_mm).norm();
    if (away > kMergedOffset * first(3)) {
      node.meets_mm[k] = std::max(node.meets_mm[k], away + kPartingRadii * first(3));
      if (node.merged && n >= kManyBranches && !branch.straight) {
        node.begins_mm[k] = first.head<3>() - node.center_mm;
      }
    }
  }
  if (!find_distances(node, distance)) return;
  aim(node, distance);
  JunctionOptions tight = options_;
  tight.margin = std::min(kLeastMargin, options_.margin);
  tight.blend = kLeastBlend * options_.blend;
  const auto wanted = opening_distances_mm(node.spec, options_);
  const auto least = opening_distances_mm(node.spec, tight);
  if (!wanted || !least) {
    node.error = wanted ? least.error() : wanted.error();
    return;
  }
  node.least_mm = *least;
  node.wanted_mm = *wanted;
  for (std::size_t k = 0; k < n; ++k) {
    node.wanted_mm[k] = std::max(node.least_mm[k], std::min(node.wanted_mm[k], node.caps_mm[k]));
    // An opening lies where its direction was taken, or it would lie beside its branch.
    if (node.wanted_mm[k] < distance[k] - kSettled * node.spec.branches[k].radius_mm) {
      node.meets_mm[k] = std::max(node.meets_mm[k], distance[k]);
    }
  }
  if (node.reach > 1) {
    for (std::size_t k = 0; k < n; ++k) {
      node.meets_mm[k] = std::max(node.meets_mm[k], node.reach * distance[k]);
    }
  }
}

// ---------------------------------------------------------------- what openings ask of bodies

// Curvature times radius of the body behind an opening, the largest: that of the path itself and of
// the beam that makes up for what the opening misses of it (modeling/body/path.cpp). With x = s / 2
// r the beam that dies out is exp(-x) (a cos x + b sin x).
double Plan::bend_behind(const PlannedNode& node, std::size_t slot, double along) const {
  const BranchEnd end = node.ends[slot];
  const PlannedBranch& branch = branches_[index(end.branch)];
  const JunctionBranch& opening = node.spec.branches[slot];
  const double r = opening.radius_mm;
  const auto at = [&](double s) { return branch.at(end.at_end ? branch.length_mm() - s : s); };
  const double step = kBendStep * r;
  const auto tangent = [&](double s) { return Vec3((at(s + step) - at(s)).head<3>() / step); };
  const double distance = std::max(node.wanted_mm[slot], node.meets_mm[slot]);
  const Vec3 a = node.center_mm + place_on_branch_mm(opening, distance) - at(along).head<3>();
  const Vec3 b = a + 2 * r * (opening.direction - tangent(along));
  double largest = 0;
  for (double s = 0; s <= kBendReach * r; s += step) {
    if (along + s + 2 * step > branch.length_mm()) break;
    const Vec3 own = (tangent(along + s + step) - tangent(along + s)) / step;
    const double x = s / (2 * r);
    const Vec3 added = std::exp(-x) * (std::sin(x) * a - std::cos(x) * b) / (2 * r * r);
    largest = std::max(largest, (own + added).norm() * at(along + s + step)(3));
  }
  return largest;
}

// The angle by which the path turns away from its opening, by how much a body behind it bends too
// tightly, and what the chord leaves of the branch.
double Plan::strain_at(const PlannedNode& node, std::size_t slot) const {
  const BranchEnd end = node.ends[slot];
  const PlannedBranch& branch = branches_[index(end.branch)];
  if (branch.straight) return 0.0;
  const JunctionBranch& opening = node.spec.branches[slot];
  const double r = opening.radius_mm;
  const double distance = std::max(node.wanted_mm[slot], node.meets_mm[slot]);
  const auto along = branch.along_at_distance(end, node.center_mm, distance);
  if (!along) return kUnmeasured;
  const auto at = [&](double s) -> Vec3 {
    return branch.at(end.at_end ? branch.length_mm() - s : s).head<3>();
  };
  const Vec3 way = at(*along + r / 2) - at(*along);
  double strain = 0;
  if (way.norm() > 0.1 * r) {
    strain = std::acos(std::clamp(way.normalized().dot(opening.direction), -1.0, 1.0));
  }
  strain += kBendStrain * std::max(0.0, bend_behind(node, slot, *along) - kTightestBend);
  const double off =
      (at(*along) - node.center_mm - place_on_branch_mm(opening, distance)).norm() / r;
  if (off > kOnItsPath) strain += off;
  // From the ray, and before it begins from the core that leads there.
  double sag = 0;
  const int steps = 1 + static_cast<int>(4 * *along / r);
  const double core = opening.offset_mm.norm();
  for (int i = 1; i < steps; ++i) {
    const Vec3 arm = at(*along * i / steps) - node.center_mm;
    const Vec3 beyond = arm - opening.offset_mm;
    if (beyond.norm() < r) continue;
    double away = (beyond - beyond.dot(opening.direction) * opening.direction).norm();
    if (core > 0) {
      const double share = std::clamp(arm.dot(opening.offset_mm) / (core * core), 0.0, 1.0);
      away = std::min(away, (arm - share * opening.offset_mm).norm());
    }
    sag = std::max(sag, away / r);
  }
  return strain + kSagStrain * std::max(0.0, sag - kAllowedSag);
}

// By how much the lumens of two branches overlap behind their openings, in radii of the thinner
// one: the junction parts them, their own paths do not. 0 where they are apart.
double Plan::overlap_behind(const PlannedNode& node, std::size_t i, std::size_t j) const {
  const auto places = [&](std::size_t slot) {
    const BranchEnd end = node.ends[slot];
    const PlannedBranch& branch = branches_[index(end.branch)];
    const double from = branch
                            .along_at_distance(end, node.center_mm,
                                               std::max(node.wanted_mm[slot], node.meets_mm[slot]))
                            .value_or(branch.length_mm());
    const double step = node.spec.branches[slot].radius_mm / 2;
    std::vector<Vec4> points;
    for (double s = from; s <= std::min(branch.length_mm(), from + 2 * kLookedAhead * step);
         s += step) {
      points.push_back(branch.at(end.at_end ? branch.length_mm() - s : s));
    }
    return points;
  };
  // Where many meet they cannot all be led apart; nor can the two ends of one loop.
  if (node.ends.size() > 3 || node.ends[i].branch == node.ends[j].branch) return 0.0;
  double deepest = 0;
  const std::vector<Vec4> second = places(j);
  for (const Vec4& p : places(i)) {
    for (const Vec4& q : second) {
      const double depth = p(3) + q(3) - (p - q).head<3>().norm();
      deepest = std::max(deepest, depth / std::min(p(3), q(3)));
    }
  }
  return deepest;
}

double Plan::strain_of(const PlannedNode& node) const {
  if (node.error) return kUnmeasured;
  double largest = 0;
  for (std::size_t k = 0; k < node.ends.size(); ++k) {
    largest = std::max(largest, strain_at(node, k));
    for (std::size_t other = 0; other < k; ++other) {
      const double depth = overlap_behind(node, k, other);
      if (depth > 0) largest = std::max(largest, kOverlapStrain + depth);
    }
  }
  return largest;
}

// Places from which the branches may part better: where two that leave together have gone some way.
std::vector<Vec3> Plan::other_centres(const PlannedNode& node) const {
  std::vector<Vec3> centres;
  const std::size_t n = node.ends.size();
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i + 1; j < n; ++j) {
      const PlannedBranch& first = branches_[index(node.ends[i].branch)];
      const PlannedBranch& second = branches_[index(node.ends[j].branch)];
      const auto at = [&](std::size_t slot, double s) {
        const PlannedBranch& branch = branches_[index(node.ends[slot].branch)];
        return branch.at(node.ends[slot].at_end ? branch.length_mm() - s : s);
      };
      const double step = (node.spec.branches[i].radius_mm + node.spec.branches[j].radius_mm) / 2;
      const auto leaves = [&](std::size_t slot) {
        return Vec3((at(slot, 2 * step) - at(slot, 0)).head<3>().normalized());
      };
      if (leaves(i).dot(leaves(j)) < std::cos(kSharedAngle)) continue;
      const double most = kMostOfABranch * std::min(first.length_mm(), second.length_mm());
      for (int k = 1; k <= kSharedRadii && k * step < most; ++k) {
        const Vec4 p = at(i, k * step);
        const Vec4 q = at(j, k * step);
        if ((p - q).head<3>().norm() > p(3) + q(3)) break;
        centres.emplace_back((p + q).head<3>() / 2);
      }
    }
  }
  return centres;
}

// Where a branch turns away right behind its opening, or the openings contradict each other, the
// centre is moved to where the branches part, or openings are moved out or in, whatever strains the
// bodies least.
void Plan::relieve(PlannedNode& node) const {
  node.relieved = true;
  double least = strain_of(node);
  if (least < kStrained) return;
  const PlannedNode given = node;
  const auto keep_better = [&](PlannedNode tried, double penalty) {
    measure(tried);
    const double strain = strain_of(tried) + penalty;
    if (strain > least - kWorthMoving) return;
    least = strain;
    node = std::move(tried);
  };
  double radius = std::numeric_limits<double>::infinity();
  for (const JunctionBranch& branch : given.spec.branches) {
    radius = std::min(radius, branch.radius_mm);
  }
  for (const Vec3& centre : other_centres(given)) {
    PlannedNode tried = given;
    tried.center_mm = centre;
    keep_better(std::move(tried), kMoveStrain * (centre - given.center_mm).norm() / radius);
  }
  // Two that overlap behind their openings: both are opened farther out.
  for (std::size_t i = 0; i < given.ends.size() && !node.error; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const PlannedNode before = node;
      if (!(overlap_behind(before, i, j) > 0)) continue;
      for (const double factor : {1.3, 1.7, 2.2, 3.0, 4.0}) {
        PlannedNode tried = before;
        bool fits = true;
        for (const std::size_t k : {i, j}) {
          tried.farther_mm[k] = factor * std::max(before.wanted_mm[k], before.meets_mm[k]);
          const PlannedBranch& branch = branches_[index(before.ends[k].branch)];
          fits = fits && tried.farther_mm[k] < kMostOfABranch * branch.length_mm();
        }
        if (fits) keep_better(std::move(tried), 0.0);
      }
    }
  }
  for (std::size_t pass = 0; pass < given.ends.size() && least >= kStrained && !node.error;
       ++pass) {
    std::size_t worst = 0;
    for (std::size_t k = 1; k < node.ends.size(); ++k) {
      if (strain_at(node, k) > strain_at(node, worst)) worst = k;
    }
    const PlannedNode before = node;
    const double reached = least;
    const double distance = std::max(before.wanted_mm[worst], before.meets_mm[worst]);
    const double most = kMostOfABranch * branches_[index(node.ends[worst].branch)].length_mm();
    for (const double factor : {1.2, 1.5, 2.0, 2.5, 3.0}) {
      if (factor * distance > most) break;
      PlannedNode tried = before;
      tried.farther_mm[worst] = factor * distance;
      keep_better(std::move(tried), 0.0);
    }
    for (const double share : {0.5, 0.0}) {
      PlannedNode tried = before;
      tried.caps_mm[worst] =
          before.least_mm[worst] + share * (before.wanted_mm[worst] - before.least_mm[worst]);
      keep_better(std::move(tried), 0.0);
    }
    if (least == reached) break;
  }
}

}  // namespace angiospline
