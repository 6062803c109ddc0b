#include "modeling/build/plan_relief.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Geometry>

#include "base/index.h"
#include "modeling/body/path.h"
#include "modeling/build/plan_measures.h"
#include "modeling/build/rules.h"

namespace angiospline {
namespace {

// ---------------------------------------------------------------- strain

// Curvature times radius of the body behind an opening, the largest: that of the path itself and of
// the beam that makes up for what the opening misses of it (modeling/body/path.h). Requires
// view.along.
double bend_behind(const PlannedNode& node, const OpeningView& view) {
  const double r = view.opening.radius_mm;
  const double along = *view.along;
  const double step = StrainRules::kBendStep * r;
  const auto tangent = [&](double s) {
    return Vec3((view.at(s + step) - view.at(s)).head<3>() / step);
  };

  // The beam on an elastic bed with ends misplaced and turned dies out, with x = s / 2 r, as
  // exp(-x) (a cos x + b sin x): a is the miss of the place, b of place and direction together.
  const Vec3 a = node.center_mm + place_on_branch_mm(view.opening, view.distance_mm) -
                 view.at(along).head<3>();
  const Vec3 b = a + 2 * r * (view.opening.direction - tangent(along));

  double largest = 0;
  for (double s = 0; s <= StrainRules::kBendReach * r; s += step) {
    if (along + s + 2 * step > view.branch.length_mm()) break;
    const Vec3 own = (tangent(along + s + step) - tangent(along + s)) / step;
    // Its second derivative.
    const double x = s / (2 * r);
    const Vec3 added = std::exp(-x) * (std::sin(x) * a - std::cos(x) * b) / (2 * r * r);
    largest = std::max(largest, (own + added).norm() * view.at(along + s + step)(3));
  }
  return largest;
}

// The largest distance, in radii, between the branch inside the junction and what the junction
// makes of it: its ray, and before that begins the core that leads there.
double sag_of(const PlannedNode& node, const OpeningView& view) {
  const JunctionBranch& opening = view.opening;
  const double r = opening.radius_mm;
  const double core = opening.offset_mm.norm();
  const int steps = 1 + static_cast<int>(4 * *view.along / r);
  double sag = 0;
  for (int i = 1; i < steps; ++i) {
    const Vec3 arm = view.at(*view.along * i / steps).head<3>() - node.center_mm;
    const Vec3 beyond = arm - opening.offset_mm;
    if (beyond.norm() < r) continue;

    double away = (beyond - beyond.dot(opening.direction) * opening.direction).norm();
    if (core > 0) {
      const double share = std::clamp(arm.dot(opening.offset_mm) / (core * core), 0.0, 1.0);
      away = std::min(away, (arm - share * opening.offset_mm).norm());
    }
    sag = std::max(sag, away / r);
  }
  return sag;
}

// Places on the branch behind an opening, half a radius apart.
std::vector<Vec4> places_behind(const OpeningView& view) {
  const double from = view.along.value_or(view.branch.length_mm());
  const double step = view.opening.radius_mm / 2;
  const double to = std::min(view.branch.length_mm(), from + 2 * StrainRules::kLookedAhead * step);
  std::vector<Vec4> places;
  for (double s = from; s <= to; s += step) places.push_back(view.at(s));
  return places;
}

// By how much the lumens of two branches overlap behind their openings, in radii of the thinner
// one: the junction parts them, their own paths do not. 0 where they are apart.
double overlap_behind(const Plan& plan, const PlannedNode& node, std::size_t i, std::size_t j) {
  // Where many meet they cannot all be led apart; nor can the two ends of one loop.
  if (node.ends.size() > StrainRules::kFewBranches) return 0.0;
  if (node.ends[i].branch == node.ends[j].branch) return 0.0;

  double deepest = 0;
  const std::vector<Vec4> second = places_behind(view_of(plan, node, j));
  for (const Vec4& p : places_behind(view_of(plan, node, i))) {
    for (const Vec4& q : second) {
      const double depth = p(3) + q(3) - (p - q).head<3>().norm();
      deepest = std::max(deepest, depth / std::min(p(3), q(3)));
    }
  }
  return deepest;
}

// ---------------------------------------------------------------- relief

// Another plan of a node, not measured yet, and the strain that it must save beside its own.
struct Candidate {
  PlannedNode node;
  double penalty = 0.0;
};

// The best plan so far.
struct Relief {
  PlannedNode node;
  double strain = 0.0;
};

// Measures all candidates and keeps the best, if it is better by what is worth a change. Whether
// any was.
bool keep_best(const Plan& plan, std::vector<Candidate> candidates, Relief& best) {
  bool better = false;
  for (Candidate& candidate : candidates) {
    PlannedNode tried = measured(plan, std::move(candidate.node));
    const double strain = strain_of(plan, tried) + candidate.penalty;
    if (strain > best.strain - ReliefRules::kWorthMoving) continue;
    best = {std::move(tried), strain};
    better = true;
  }
  return better;
}

// The centre moved forward to where two branches that leave together have gone some way.
std::vector<Candidate> moved_centres(const Plan& plan, const PlannedNode& given) {
  double radius = std::numeric_limits<double>::infinity();
  for (const JunctionBranch& branch : given.spec.branches) {
    radius = std::min(radius, branch.radius_mm);
  }
  std::vector<Candidate> candidates;
  for (const Vec3& centre : other_centres(plan, given)) {
    candidates.push_back(
        {given, ReliefRules::kMoveStrain * (centre - given.center_mm).norm() / radius});
    candidates.back().node.center_mm = centre;
  }
  return candidates;
}

// Two openings moved farther out together, while their branches keep enough of themselves.
std::vector<Candidate> both_farther(const Plan& plan, const PlannedNode& given, std::size_t i,
                                    std::size_t j) {
  std::vector<Candidate> candidates;
  for (const double factor : ReliefRules::kBothFarther) {
    Candidate tried{given};
    bool fits = true;
    for (const std::size_t k : {i, j}) {
      tried.node.farther_mm[k] = factor * given.follows_mm(k);
      fits = fits && tried.node.farther_mm[k] <
                         ReliefRules::kMostOfABranch * plan.branch(given.ends[k]).length_mm();
    }
    if (fits) candidates.push_back(std::move(tried));
  }
  return candidates;
}

// One opening moved farther out, or nearer.
std::vector<Candidate> farther_or_nearer(const Plan& plan, const PlannedNode& given,
                                         std::size_t slot) {
  std::vector<Candidate> candidates;
  const double most = ReliefRules::kMostOfABranch * plan.branch(given.ends[slot]).length_mm();
  for (const double factor : ReliefRules::kOneFarther) {
    const double distance = factor * given.follows_mm(slot);
    if (distance > most) break;
    candidates.push_back({given});
    candidates.back().node.farther_mm[slot] = distance;
  }

  for (const double share : ReliefRules::kOneNearer) {
    candidates.push_back({given});
    candidates.back().node.caps_mm[slot] =
        given.least_mm[slot] + share * (given.wanted_mm[slot] - given.least_mm[slot]);
  }
  return candidates;
}

std::size_t most_strained(const Plan& plan, const PlannedNode& node) {
  std::size_t worst = 0;
  for (std::size_t k = 1; k < node.ends.size(); ++k) {
    if (strain_at(plan, node, k) > strain_at(plan, node, worst)) worst = k;
  }
  return worst;
}

}  // namespace

OpeningView view_of(const Plan& plan, const PlannedNode& node, std::size_t slot) {
  const BranchEnd end = node.ends[slot];
  const PlannedBranch& branch = plan.branch(end);
  const double distance = node.follows_mm(slot);
  return {end, branch, node.spec.branches[slot], distance,
          branch.along_at_distance(end, node.center_mm, distance)};
}

double strain_at(const Plan& plan, const PlannedNode& node, std::size_t slot) {
  if (plan.branch(node.ends[slot]).straight) return 0.0;
  const OpeningView view = view_of(plan, node, slot);
  if (!view.along) return StrainRules::kUnmeasured;
  const double along = *view.along;
  const double r = view.opening.radius_mm;

  // The turn from the opening's axis to the path, within half a radius behind it.
  double strain = 0;
  const Vec3 way = (view.at(along + r / 2) - view.at(along)).head<3>();
  if (way.norm() > 0.1 * r) {
    strain = std::acos(std::clamp(way.normalized().dot(view.opening.direction), -1.0, 1.0));
  }

  // What the body bends too tightly.
  strain += StrainRules::kBendStrain * std::max(0.0, bend_behind(node, view) - kTightestBend);

  // An opening beside its branch, and a branch beside its chord.
  const double off = (view.at(along).head<3>() - node.center_mm -
                      place_on_branch_mm(view.opening, view.distance_mm))
                         .norm() /
                     r;
  if (off > StrainRules::kOnItsPath) strain += off;
  return strain +
         StrainRules::kSagStrain * std::max(0.0, sag_of(node, view) - StrainRules::kAllowedSag);
}

double strain_of(const Plan& plan, const PlannedNode& node) {
  if (node.error) return StrainRules::kUnmeasured;
  double largest = 0;
  for (std::size_t k = 0; k < node.ends.size(); ++k) {
    largest = std::max(largest, strain_at(plan, node, k));
    for (std::size_t other = 0; other < k; ++other) {
      const double depth = overlap_behind(plan, node, k, other);
      if (depth > 0) largest = std::max(largest, StrainRules::kOverlapStrain + depth);
    }
  }
  return largest;
}

std::vector<Vec3> other_centres(const Plan& plan, const PlannedNode& node) {
  std::vector<Vec3> centres;
  const std::size_t n = node.ends.size();
  const auto at = [&](std::size_t slot, double s) {
    return plan.branch(node.ends[slot]).at_from(node.ends[slot], s);
  };
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i + 1; j < n; ++j) {
      // Only of two that leave the same way is one the other's detour.
      const double step = (node.spec.branches[i].radius_mm + node.spec.branches[j].radius_mm) / 2;
      const auto leaves = [&](std::size_t slot) {
        return Vec3((at(slot, 2 * step) - at(slot, 0)).head<3>().normalized());
      };
      if (leaves(i).dot(leaves(j)) < std::cos(ReliefRules::kSharedAngle)) continue;

      // Halfway between the two, a radius at a time, for as long as their lumens overlap.
      const double most =
          ReliefRules::kMostOfABranch *
          std::min(plan.branch(node.ends[i]).length_mm(), plan.branch(node.ends[j]).length_mm());
      for (int k = 1; k <= ReliefRules::kSharedRadii && k * step < most; ++k) {
        const Vec4 p = at(i, k * step);
        const Vec4 q = at(j, k * step);
        if ((p - q).head<3>().norm() > p(3) + q(3)) break;
        centres.emplace_back((p + q).head<3>() / 2);
      }
    }
  }
  return centres;
}

PlannedNode relieved(const Plan& plan, PlannedNode node) {
  node.relieved = true;
  const PlannedNode given = node;
  Relief best{std::move(node), strain_of(plan, given)};
  if (best.strain < ReliefRules::kStrained) return std::move(best.node);

  keep_best(plan, moved_centres(plan, given), best);

  // Two that overlap behind their openings: both are opened farther out.
  const std::size_t n = given.ends.size();
  for (std::size_t i = 0; i < n && !best.node.error; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (!(overlap_behind(plan, best.node, i, j) > 0)) continue;
      keep_best(plan, both_farther(plan, best.node, i, j), best);
    }
  }

  // Then the opening that strains its body the most, and the next, while that helps.
  for (std::size_t pass = 0; pass < n; ++pass) {
    if (!(best.strain >= ReliefRules::kStrained) || best.node.error) break;
    const std::size_t worst = most_strained(plan, best.node);
    if (!keep_best(plan, farther_or_nearer(plan, best.node, worst), best)) break;
  }
  return std::move(best.node);
}

}  // namespace angiospline
