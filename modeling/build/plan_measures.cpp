#include "modeling/build/plan_measures.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "base/index.h"
#include "modeling/build/rules.h"

namespace angiospline {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Every branch's direction: to where its path comes to `distance` from the centre.
void aim(const Plan& plan, PlannedNode& node, const std::vector<double>& distance) {
  for (std::size_t k = 0; k < node.ends.size(); ++k) {
    const BranchEnd end = node.ends[k];
    const PlannedBranch& branch = plan.branch(end);
    const double meets = std::max(node.meets_mm[k], node.reach * distance[k]);
    const double s =
        branch.along_at_distance(end, node.center_mm, meets).value_or(branch.length_mm());
    Vec4 target = branch.at_from(end, s);
    const double radius = target(3);
    if (branch.straight) target.head<3>() = plan.node(end.opposite()).center_mm;

    // A branch that bends inside the junction keeps to its path for a share of the way.
    if (node.bent_at[k] > 0 && !branch.straight) {
      const double begins = node.bent_at[k] * s;
      node.begins_mm[k] = branch.at_from(end, begins).head<3>() - node.center_mm;
    }
    const Vec3 chord = target.head<3>() - node.center_mm - node.begins_mm[k];
    node.spec.branches[k] = {branch.name, chord.normalized(), radius, 0.0, node.begins_mm[k]};
  }
}

// For each opening, what is known of the distance at which the path and its direction agree.
struct Brackets {
  std::vector<double> too_near;
  std::vector<double> enough;

  explicit Brackets(std::size_t n) : too_near(n, 0.0), enough(n, kInfinity) {}
  void learn(std::size_t k, double distance, double needed) {
    if (needed > distance) {
      too_near[k] = std::max(too_near[k], distance);
    } else {
      enough[k] = std::min(enough[k], distance);
    }
  }
  bool closed(std::size_t k) const { return too_near[k] < enough[k] && std::isfinite(enough[k]); }
};

// Branches that leave together part farther out: there directions are looked for next.
void look_farther(PlannedNode& node, std::vector<double>& distance, Brackets& known) {
  for (std::size_t k = 0; k < distance.size(); ++k) {
    known.too_near[k] = std::max(known.too_near[k], distance[k]);
    distance[k] *= OpeningRules::kFarther;
    if (node.meets_mm[k] > 0) {
      node.meets_mm[k] += OpeningRules::kMeetsLater * node.spec.branches[k].radius_mm;
    }
  }
}

// One step towards the fixed point: plain at first, then damped, then by bisection. Returns the
// largest change, in radii.
double step_to(const PlannedNode& node, const std::vector<double>& needed_mm, int round,
               std::vector<double>& distance, Brackets& known) {
  double change = 0;
  for (std::size_t k = 0; k < distance.size(); ++k) {
    const double needed = std::min(needed_mm[k], node.caps_mm[k]);
    known.learn(k, distance[k], needed);
    const double to = round < OpeningRules::kDamped ? needed
                      : round >= OpeningRules::kBisected && known.closed(k)
                          ? (known.too_near[k] + known.enough[k]) / 2
                          : (needed + distance[k]) / 2;
    change = std::max(change, std::abs(to - distance[k]) / node.spec.branches[k].radius_mm);
    distance[k] = to;
  }
  return change;
}

// Directions are those from the centre to the openings' centres on the paths, whose distances
// depend on the directions: a fixed point, found by repetition from the nearest possible openings
// outward. Where a path turns, distances that are too near and ones that are far enough may follow
// each other without end: then the boundary is bisected, and the far side of it taken. Nothing if
// the directions of the last round allow no openings.
std::optional<std::vector<double>> find_distances(const Plan& plan, PlannedNode& node,
                                                  std::vector<double> distance) {
  Brackets known(distance.size());
  int refused = 0;
  for (int round = 0; round < OpeningRules::kDirectionRounds; ++round) {
    aim(plan, node, distance);
    const auto next = opening_distances_mm(node.spec, plan.options);
    if (!next) {
      node.error = next.error();
      if (++refused > OpeningRules::kMostRefused) return std::nullopt;
      look_farther(node, distance, known);
      continue;
    }
    node.error.reset();
    if (step_to(node, *next, round, distance, known) < OpeningRules::kSettled) break;
  }
  if (node.error) return std::nullopt;

  for (std::size_t k = 0; k < distance.size(); ++k) {
    const double step = known.enough[k] - distance[k];
    if (step > 0 && step < node.spec.branches[k].radius_mm) distance[k] = known.enough[k];
  }
  return distance;
}

// Forgets what was measured before, and keeps what was asked for; returns the distances to begin
// with: a radius, seen from where each branch passes the centre.
std::vector<double> start_over(const Plan& plan, PlannedNode& node) {
  const std::size_t n = node.ends.size();
  node.spec.center_mm = node.center_mm;
  node.spec.branches.assign(n, {});
  node.meets_mm.assign(n, 0.0);
  node.begins_mm.assign(n, Vec3::Zero());
  node.caps_mm.resize(n, kInfinity);
  node.farther_mm.resize(n, 0.0);
  node.bent_at.resize(n, 0.0);
  node.error.reset();

  std::vector<double> distance(n);
  for (std::size_t k = 0; k < n; ++k) {
    const BranchEnd end = node.ends[k];
    const PlannedBranch& branch = plan.branch(end);
    const Vec4 first = branch.at_from(end, branch.along_nearest(end, node.center_mm));
    distance[k] = first(3);
    node.meets_mm[k] = node.farther_mm[k];

    // Branches of a merged node may begin away from its centre: they part beyond where they begin.
    const double away = (first.head<3>() - node.center_mm).norm();
    if (!(away > OpeningRules::kMergedOffset * first(3))) continue;
    node.meets_mm[k] = std::max(node.meets_mm[k], away + OpeningRules::kPartingRadii * first(3));
    if (node.merged && n >= OpeningRules::kManyBranches && !branch.straight) {
      node.begins_mm[k] = first.head<3>() - node.center_mm;
    }
  }
  return distance;
}

JunctionOptions tightest(JunctionOptions options) {
  options.margin = std::min(OpeningRules::kLeastMargin, options.margin);
  options.blend = OpeningRules::kLeastBlend * options.blend;
  return options;
}

}  // namespace

PlannedNode measured(const Plan& plan, PlannedNode node) {
  std::vector<double> nearest = start_over(plan, node);
  const auto distance = find_distances(plan, node, std::move(nearest));
  if (!distance) return node;

  // With the directions found, how far out the openings are wanted and how near they may come.
  aim(plan, node, *distance);
  const auto wanted = opening_distances_mm(node.spec, plan.options);
  const auto least = opening_distances_mm(node.spec, tightest(plan.options));
  if (!wanted || !least) {
    node.error = wanted ? least.error() : wanted.error();
    return node;
  }
  node.least_mm = *least;
  node.wanted_mm = *wanted;

  // An opening lies where its direction was taken, or it would lie beside its branch; and a body
  // follows its path only from where the direction was looked for.
  for (std::size_t k = 0; k < node.ends.size(); ++k) {
    node.wanted_mm[k] = std::max(node.least_mm[k], std::min(node.wanted_mm[k], node.caps_mm[k]));
    const double rounding = OpeningRules::kSettled * node.spec.branches[k].radius_mm;
    if (node.wanted_mm[k] < (*distance)[k] - rounding || node.reach > 1) {
      node.meets_mm[k] = std::max(node.meets_mm[k], node.reach * (*distance)[k]);
    }
  }
  return node;
}

}  // namespace angiospline
