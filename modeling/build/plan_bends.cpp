#include "modeling/build/plan_bends.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

#include <tbb/parallel_for.h>

#include "base/contract.h"
#include "base/index.h"
#include "modeling/body/path.h"
#include "modeling/build/plan_measures.h"
#include "modeling/build/plan_relief.h"
#include "modeling/build/plan_room.h"
#include "modeling/build/plan_settling.h"
#include "modeling/build/rules.h"

namespace angiospline {
namespace {

// A plan of a node and what it asks of bodies, dearer by what was changed for it.
struct Eased {
  PlannedNode node;
  double moved = 0.0;         // for the centre
  std::vector<double> costs;  // of the body behind each opening
  double strain = 0.0;

  double cost() const { return *std::max_element(costs.begin(), costs.end()); }
  double score() const { return strain + moved + cost(); }
  bool is_good() const {
    return strain < ReliefRules::kStrained && cost() < InnerBendRules::kCostly;
  }
};

bool scores_less(const Eased& a, const Eased& b) { return a.score() < b.score(); }

// ---------------------------------------------------------------- what a body would give up

// The stretch of a branch over which a body is looked at, and what it would end at.
struct Stretch {
  double to = 0.0;  // arc length from the opening's end
  PathEnd last;
};

// Twelve radii, or up to the opening opposite, if that comes first.
Stretch stretch_behind(const Plan& plan, const OpeningView& view) {
  const PlannedBranch& branch = view.branch;
  Stretch stretch;
  stretch.to = *view.along + InnerBendRules::kCostReach * view.opening.radius_mm;

  const BranchEnd far = view.end.opposite();
  const PlannedNode& other = plan.node(far);
  if (other.is_junction() && !other.error && branch.from != branch.to) {
    const std::size_t k = plan.slot(far);
    const double back = branch.along_at_distance(far, other.center_mm, other.follows_mm(k))
                            .value_or(branch.length_mm());
    if (branch.length_mm() - back <= stretch.to) {
      stretch.to = branch.length_mm() - back;
      const JunctionBranch& facing = other.spec.branches[k];
      stretch.last = {other.center_mm + place_on_branch_mm(facing, other.wanted_mm[k]),
                      facing.radius_mm, -facing.direction};
    }
  }

  stretch.to = std::min(stretch.to, branch.length_mm());
  if (stretch.last.radius_mm == 0) {
    const Vec4 place = view.at(stretch.to);
    stretch.last = {place.head<3>(), place(3), Vec3::Zero()};
  }
  return stretch;
}

// The largest distance, in radii, from the body's path to what lies between the opening and where
// the branch's path is met again.
double departure_before(const PlannedNode& node, const OpeningView& view, std::size_t slot,
                        const BodyPath& path) {
  const auto opens = view.branch.along_at_distance(view.end, node.center_mm, node.wanted_mm[slot]);
  if (!opens) return 0.0;
  const double from = *view.along;
  const int skipped =
      static_cast<int>(InnerBendRules::kCostSamples * (from - *opens) / view.opening.radius_mm);
  double off = 0;
  for (int i = 0; i < skipped; ++i) {
    const Vec4 place = view.at(*opens + (from - *opens) * i / skipped);
    off = std::max(off, departure_from(path.curve, place, {0.0}).radii);
  }
  return off;
}

// What the body behind an opening would give up if it began as planned: 1 for a twentieth of the
// radius, or for a radius between its axis and the path. Measured over twelve radii, on the very
// path that the body would be swept along.
double cost_at(const Plan& plan, const PlannedNode& node, std::size_t slot) {
  if (plan.branch(node.ends[slot]).straight) return 0.0;
  const OpeningView view = view_of(plan, node, slot);
  if (!view.along) return InnerBendRules::kMostCost;
  const double from = *view.along;
  const double r = view.opening.radius_mm;
  const Stretch stretch = stretch_behind(plan, view);
  const int count = static_cast<int>(InnerBendRules::kCostSamples * (stretch.to - from) / r);
  if (count < 4) return 0.0;

  Eigen::Matrix4Xd target(4, count - 1);
  std::vector<double> parameters;
  for (int i = 1; i < count; ++i) {
    parameters.push_back(static_cast<double>(i) / count);
    target.col(i - 1) = view.at(from + (stretch.to - from) * parameters.back());
  }
  const PathEnd first{node.center_mm + place_on_branch_mm(view.opening, node.wanted_mm[slot]), r,
                      view.opening.direction};
  const BodyPath path = fit_body_path(target, first, stretch.last);

  const double off = std::max(departure_from(path.curve, target, parameters).radii,
                              departure_before(node, view, slot, path));
  return std::min(InnerBendRules::kMostCost,
                  std::max(path.narrowed / InnerBendRules::kNarrowedCost, off));
}

std::vector<double> costs_of(const Plan& plan, const PlannedNode& node) {
  std::vector<double> costs;
  for (std::size_t k = 0; k < node.ends.size(); ++k) costs.push_back(cost_at(plan, node, k));
  return costs;
}

// ---------------------------------------------------------------- other ways to plan a node

// The opening that asks the most of its body, in strain and cost together.
std::size_t most_asking(const Plan& plan, const Eased& eased) {
  const auto asks = [&](std::size_t k) { return strain_at(plan, eased.node, k) + eased.costs[k]; };
  std::size_t worst = 0;
  for (std::size_t k = 1; k < eased.node.ends.size(); ++k) {
    if (asks(k) > asks(worst)) worst = k;
  }
  return worst;
}

// One opening moved out, or its branch bent inside the junction, or both, in all the ways there
// are. All that are nearly the best are kept in `found`; returns the best, `before` if none is
// better.
Eased best_of_ways(const Plan& plan, const Eased& before, std::size_t slot,
                   std::vector<Eased>& found) {
  Eased best = before;
  const double distance = before.node.follows_mm(slot);
  const double most = ReliefRules::kMostOfABranch * plan.branch(before.node.ends[slot]).length_mm();
  for (const double share : InnerBendRules::kBentAt) {
    for (const double factor : InnerBendRules::kFarther) {
      if ((share == 0 && factor == 1) || (factor > 1 && factor * distance > most)) continue;
      Eased tried = before;
      tried.node.bent_at[slot] = share;
      if (factor > 1) tried.node.farther_mm[slot] = factor * distance;
      tried.node = measured(plan, std::move(tried.node));
      tried.strain = strain_of(plan, tried.node);

      // The strain alone says whether the cost, a fit of a whole path, is worth knowing.
      tried.costs[slot] = 0;
      if (tried.score() >= best.score() + InnerBendRules::kNearly) continue;
      tried.costs[slot] = cost_at(plan, tried.node, slot);
      found.push_back(tried);
      if (tried.score() < best.score() - InnerBendRules::kWorthBending) best = std::move(tried);
    }
  }
  return best;
}

// The opening that asks the most of its body is eased; then the next.
void ease(const Plan& plan, Eased best, std::vector<Eased>& found) {
  const std::size_t n = best.node.ends.size();
  for (std::size_t pass = 0; pass < n; ++pass) {
    if (best.node.error || best.is_good()) break;
    const double reached = best.score();
    best = best_of_ways(plan, best, most_asking(plan, best), found);
    if (best.score() == reached) break;
  }
}

// The node with its centre where branches part better, as far as there are openings; their costs
// are not known yet.
std::vector<Eased> from_other_centres(const Plan& plan, const PlannedNode& node) {
  double radius = std::numeric_limits<double>::infinity();
  for (const JunctionBranch& branch : node.spec.branches) {
    radius = std::min(radius, branch.radius_mm);
  }

  std::vector<Eased> starts;
  for (const Vec3& centre : other_centres(plan, node)) {
    PlannedNode tried = node;
    tried.center_mm = centre;
    tried = measured(plan, std::move(tried));
    if (tried.error) continue;
    const double moved = ReliefRules::kMoveStrain * (centre - node.center_mm).norm() / radius;
    const double strain = strain_of(plan, tried);
    starts.push_back({std::move(tried), moved, std::vector<double>(node.ends.size(), 0.0), strain});
  }
  return starts;
}

// What can be had from a few centres, the best first, each bending other branches or bending them
// elsewhere: nothing if it is not worth it.
std::vector<PlannedNode> eased(const Plan& plan, const PlannedNode& node) {
  if (node.error) return {};
  const Eased given{node, 0.0, costs_of(plan, node), strain_of(plan, node)};
  if (given.is_good()) return {};

  // The centre as it is, and the best of the others.
  std::vector<Eased> found;
  ease(plan, given, found);
  std::vector<Eased> others = from_other_centres(plan, node);
  std::stable_sort(others.begin(), others.end(), scores_less);
  others.resize(std::min(others.size(), InnerBendRules::kStarts - 1));
  for (Eased& start : others) {
    start.costs = costs_of(plan, start.node);
    found.push_back(start);
    ease(plan, start, found);
  }

  std::stable_sort(found.begin(), found.end(), scores_less);
  std::vector<PlannedNode> chosen;
  for (Eased& next : found) {
    if (chosen.size() == kBendAlternatives) break;
    if (next.score() > given.score() - InnerBendRules::kWorthBending) break;
    const bool is_new = std::none_of(chosen.begin(), chosen.end(), [&](const PlannedNode& other) {
      return other.bent_at == next.node.bent_at;
    });
    if (is_new) chosen.push_back(std::move(next.node));
  }
  return chosen;
}

}  // namespace

void find_bends(Plan& plan) {
  plan.bends.assign(plan.nodes.size(), {});
  tbb::parallel_for(std::size_t{0}, plan.nodes.size(), [&](std::size_t n) {
    if (plan.nodes[n].is_junction()) plan.bends[n] = eased(plan, plan.nodes[n]);
  });
}

std::vector<int> bend(Plan& plan, const std::vector<int>& refused) {
  EXPECTS(plan.bends.size() == plan.nodes.size() && refused.size() == plan.nodes.size());
  std::vector<int> bent;
  for (std::size_t n = 0; n < plan.nodes.size(); ++n) {
    for (std::size_t k = index(refused[n]); k < plan.bends[n].size(); ++k) {
      std::swap(plan.nodes[n], plan.bends[n][k]);
      // No branch may be left without room: that would change more of the plan than it mends.
      const std::vector<BranchEnd>& ends = plan.nodes[n].ends;
      const bool fits = std::all_of(ends.begin(), ends.end(), [&](const BranchEnd& end) {
        const BranchRoom room = room_of(plan, end.branch);
        return room.known && room.fits();
      });
      if (fits) {
        bent.push_back(static_cast<int>(n));
        break;
      }
      std::swap(plan.nodes[n], plan.bends[n][k]);
    }
  }

  if (!bent.empty() && tighten(plan)) settle(plan);
  return bent;
}

}  // namespace angiospline
