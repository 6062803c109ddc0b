// Branches that bend inside their junction: planned last, where openings still strain the bodies.
#include <algorithm>
#include <limits>
#include <optional>
#include <vector>

#include <tbb/parallel_for.h>

#include "base/contract.h"
#include "base/index.h"
#include "modeling/body/path.h"
#include "modeling/build/plan.h"

namespace angiospline {
namespace {

constexpr double kStrained = 0.6;      // radians, and what else strains, that are worth the search
constexpr double kCostly = 0.9;        // of a body, likewise
constexpr double kWorthBending = 0.2;  // by which the two together must become less
constexpr double kMoveStrain = 0.04;   // of a centre moved by a radius
constexpr std::size_t kStarts = 4;     // the centre as it is, and the best of the others
constexpr double kMostOfABranch = 0.45;  // that a junction may take
constexpr double kNearly = 0.4;          // worse than the best, and still worth a look
constexpr double kCostReach = 12.0;      // radii of body that are looked at
constexpr double kCostSamples = 6.0;     // to each
constexpr double kNarrowedCost = 0.05;   // of the radius, as bad as a radius between the axes
constexpr double kMostCost = 4.0;

}  // namespace

// A plan of a node and what it asks of bodies, dearer by what was changed for it.
struct Plan::Eased {
  PlannedNode node;
  double moved = 0.0;         // for the centre
  std::vector<double> costs;  // of the body behind each opening
  double strain = 0.0;

  double cost() const { return *std::max_element(costs.begin(), costs.end()); }
  double score() const { return strain + moved + cost(); }
};

// What the body behind an opening would give up if it began as planned: 1 for a twentieth of the
// radius, or for a radius between its axis and the path. Measured over twelve radii.
double Plan::cost_at(const PlannedNode& node, std::size_t slot) const {
  const BranchEnd end = node.ends[slot];
  const PlannedBranch& branch = branches_[index(end.branch)];
  if (branch.straight) return 0.0;
  const JunctionBranch& opening = node.spec.branches[slot];
  const double r = opening.radius_mm;
  const double distance = std::max(node.wanted_mm[slot], node.meets_mm[slot]);
  const auto from = branch.along_at_distance(end, node.center_mm, distance);
  if (!from) return kMostCost;
  const auto at = [&](double s) { return branch.at(end.at_end ? branch.length_mm() - s : s); };
  PathEnd last;
  double to = *from + kCostReach * r;
  const BranchEnd far{end.branch, !end.at_end};
  const PlannedNode& other = node_at(far);
  if (other.is_junction() && !other.error && branch.from != branch.to) {
    const auto k = index(slot_of(far));
    const double opens = std::max(other.wanted_mm[k], other.meets_mm[k]);
    const double back =
        branch.along_at_distance(far, other.center_mm, opens).value_or(branch.length_mm());
    if (branch.length_mm() - back <= to) {
      to = branch.length_mm() - back;
      const JunctionBranch& facing = other.spec.branches[k];
      last = {other.center_mm + place_on_branch_mm(facing, other.wanted_mm[k]), facing.radius_mm,
              -facing.direction};
    }
  }
  to = std::min(to, branch.length_mm());
  if (last.radius_mm == 0) last = {at(to).head<3>(), at(to)(3), Vec3::Zero()};
  const int count = static_cast<int>(kCostSamples * (to - *from) / r);
  if (count < 4) return 0.0;
  Eigen::Matrix4Xd target(4, count - 1);
  std::vector<double> parameters;
  for (int i = 1; i < count; ++i) {
    parameters.push_back(static_cast<double>(i) / count);
    target.col(i - 1) = at(*from + (to - *from) * parameters.back());
  }
  const PathEnd first{node.center_mm + place_on_branch_mm(opening, node.wanted_mm[slot]), r,
                      opening.direction};
  const BodyPath path = fit_body_path(target, first, last);
  double off = departure_from(path.curve, target, parameters).radii;
  // What lies between the opening and where the path is met again.
  const auto opens = branch.along_at_distance(end, node.center_mm, node.wanted_mm[slot]);
  const int skipped = opens ? static_cast<int>(kCostSamples * (*from - *opens) / r) : 0;
  for (int i = 0; i < skipped; ++i) {
    const Vec4 place = at(*opens + (*from - *opens) * i / skipped);
    off = std::max(off, departure_from(path.curve, place, {0.0}).radii);
  }
  return std::min(kMostCost, std::max(path.narrowed / kNarrowedCost, off));
}

std::vector<double> Plan::costs_of(const PlannedNode& node) const {
  std::vector<double> costs;
  for (std::size_t k = 0; k < node.ends.size(); ++k) costs.push_back(cost_at(node, k));
  return costs;
}

// The opening that asks the most of its body is moved out, or its branch bends inside the junction,
// or both; then the next. All that were nearly the best are kept in `found`.
void Plan::ease(Eased best, std::vector<Eased>& found) const {
  const std::size_t n = best.node.ends.size();
  for (std::size_t pass = 0; pass < n && !best.node.error; ++pass) {
    if (best.strain < kStrained && best.cost() < kCostly) break;
    const Eased before = best;
    const auto asks = [&](std::size_t k) { return strain_at(before.node, k) + before.costs[k]; };
    std::size_t worst = 0;
    for (std::size_t k = 1; k < n; ++k) {
      if (asks(k) > asks(worst)) worst = k;
    }
    const double distance = std::max(before.node.wanted_mm[worst], before.node.meets_mm[worst]);
    const double most =
        kMostOfABranch * branches_[index(before.node.ends[worst].branch)].length_mm();
    for (const double share : {0.0, 0.3, 0.5, 0.7, 0.8}) {
      for (const double factor : {1.0, 1.2, 1.5, 2.0, 2.5, 3.0}) {
        if ((share == 0 && factor == 1) || (factor > 1 && factor * distance > most)) continue;
        Eased tried = before;
        tried.node.bent_at[worst] = share;
        if (factor > 1) tried.node.farther_mm[worst] = factor * distance;
        measure(tried.node);
        tried.strain = strain_of(tried.node);
        tried.costs[worst] = 0;
        if (tried.score() >= best.score() + kNearly) continue;
        tried.costs[worst] = cost_at(tried.node, worst);
        found.push_back(tried);
        if (tried.score() < best.score() - kWorthBending) best = std::move(tried);
      }
    }
    if (best.score() == before.score()) break;
  }
}

// What can be had from a few centres, the best first, each bending other branches or bending them
// elsewhere: nothing if it is not worth it.
std::vector<PlannedNode> Plan::eased(const PlannedNode& node) const {
  if (node.error) return {};
  std::vector<Eased> starts{{node, 0.0, costs_of(node), strain_of(node)}};
  const double given = starts.front().score();
  if (starts.front().strain < kStrained && starts.front().cost() < kCostly) return {};
  double radius = std::numeric_limits<double>::infinity();
  for (const JunctionBranch& branch : node.spec.branches) {
    radius = std::min(radius, branch.radius_mm);
  }
  for (const Vec3& centre : other_centres(node)) {
    PlannedNode tried = node;
    tried.center_mm = centre;
    measure(tried);
    if (tried.error) continue;
    const double moved = kMoveStrain * (centre - node.center_mm).norm() / radius;
    const double strain = strain_of(tried);
    starts.push_back({std::move(tried), moved, std::vector<double>(node.ends.size(), 0.0), strain});
  }
  const auto less = [](const Eased& a, const Eased& b) { return a.score() < b.score(); };
  std::stable_sort(starts.begin() + 1, starts.end(), less);
  starts.resize(std::min(starts.size(), kStarts));
  std::vector<Eased> found;
  for (std::size_t k = 0; k < starts.size(); ++k) {
    if (k > 0) {
      starts[k].costs = costs_of(starts[k].node);
      found.push_back(starts[k]);
    }
    ease(starts[k], found);
  }
  std::stable_sort(found.begin(), found.end(), less);
  std::vector<PlannedNode> chosen;
  for (Eased& next : found) {
    if (chosen.size() == kAlternatives || next.score() > given - kWorthBending) break;
    const bool is_new = std::none_of(chosen.begin(), chosen.end(), [&](const PlannedNode& other) {
      return other.bent_at == next.node.bent_at;
    });
    if (is_new) chosen.push_back(std::move(next.node));
  }
  return chosen;
}

void Plan::find_bends() {
  bends_.assign(nodes_.size(), {});
  tbb::parallel_for(std::size_t{0}, nodes_.size(), [&](std::size_t n) {
    if (nodes_[n].is_junction()) bends_[n] = eased(nodes_[n]);
  });
}

std::vector<int> Plan::bend(const std::vector<int>& refused) {
  EXPECTS(bends_.size() == nodes_.size() && refused.size() == nodes_.size());
  std::vector<int> bent;
  for (std::size_t n = 0; n < nodes_.size(); ++n) {
    for (std::size_t k = index(refused[n]); k < bends_[n].size(); ++k) {
      std::swap(nodes_[n], bends_[n][k]);
      // No branch may be left without room: that would change more of the plan than it mends.
      const bool fits = std::all_of(nodes_[n].ends.begin(), nodes_[n].ends.end(),
                                    [&](const BranchEnd& end) { return has_room(end.branch); });
      if (fits) {
        bent.push_back(static_cast<int>(n));
        break;
      }
      std::swap(nodes_[n], bends_[n][k]);
    }
  }
  if (!bent.empty() && tighten()) settle();
  return bent;
}

}  // namespace angiospline
