// Branches that bend inside their junction: planned last, where openings still strain the bodies.
#include <algorithm>
#include <limits>

#include <tbb/parallel_for.h>

#include "modeling/seed_plan.h"

namespace angiospline {
namespace {

constexpr double kStrained = 0.6;      // radians, and what else strains, that are worth the search
constexpr double kWorthBending = 0.2;  // by which the strain must become less
constexpr double kMoveStrain = 0.04;   // of a centre moved by a radius
constexpr std::size_t kStarts = 4;     // the centre as it is, and the best of the others
constexpr double kMostOfABranch = 0.45;  // that a junction may take

std::size_t index(int i) { return static_cast<std::size_t>(i); }

}  // namespace

// A plan of a node and what it asks of bodies, dearer by what was changed for it.
struct SeedPlan::Eased {
  PlannedNode node;
  double strain = 0.0;
};

// The most strained opening is moved out, or its branch bends inside the junction, or both; then
// the next.
void SeedPlan::ease(Eased& best) const {
  const std::size_t n = best.node.ends.size();
  for (std::size_t pass = 0; pass < n && best.strain >= kStrained && !best.node.error; ++pass) {
    std::size_t worst = 0;
    for (std::size_t k = 1; k < n; ++k) {
      if (strain_at(best.node, k) > strain_at(best.node, worst)) worst = k;
    }
    const PlannedNode before = best.node;
    const double reached = best.strain;
    const double distance = std::max(before.wanted_mm[worst], before.meets_mm[worst]);
    const double most = kMostOfABranch * branches_[index(before.ends[worst].branch)].length_mm();
    for (const double share : {0.0, 0.3, 0.5, 0.7}) {
      for (const double factor : {1.0, 1.2, 1.5, 2.0, 2.5, 3.0}) {
        if ((share == 0 && factor == 1) || (factor > 1 && factor * distance > most)) continue;
        PlannedNode tried = before;
        tried.bent_at[worst] = share;
        if (factor > 1) tried.farther_mm[worst] = factor * distance;
        measure(tried);
        const double strain = strain_of(tried);
        if (strain < best.strain - kWorthBending) best = {std::move(tried), strain};
      }
    }
    if (best.strain == reached) break;
  }
}

// The best that can be had from a few centres: nothing if it is not worth it.
std::optional<PlannedNode> SeedPlan::eased(const PlannedNode& node) const {
  std::vector<Eased> starts{{node, strain_of(node)}};
  const double given = starts.front().strain;
  if (node.error || given < kStrained) return std::nullopt;
  double radius = std::numeric_limits<double>::infinity();
  for (const JunctionBranch& branch : node.spec.branches) {
    radius = std::min(radius, branch.radius_mm);
  }
  for (const Vec3& centre : other_centres(node)) {
    PlannedNode tried = node;
    tried.center_mm = centre;
    measure(tried);
    const double away = (centre - node.center_mm).norm() / radius;
    const double strain = strain_of(tried) + kMoveStrain * away;
    starts.push_back({std::move(tried), strain});
  }
  const auto less = [](const Eased& a, const Eased& b) { return a.strain < b.strain; };
  std::stable_sort(starts.begin() + 1, starts.end(), less);
  starts.resize(std::min(starts.size(), kStarts));
  for (Eased& start : starts) ease(start);
  Eased& best = *std::min_element(starts.begin(), starts.end(), less);
  if (best.strain > given - kWorthBending) return std::nullopt;
  return std::move(best.node);
}

std::vector<int> SeedPlan::bend(const std::vector<char>& excluded) {
  std::vector<std::optional<PlannedNode>> found(nodes_.size());
  tbb::parallel_for(std::size_t{0}, nodes_.size(), [&](std::size_t n) {
    if (nodes_[n].is_junction() && excluded[n] == 0) found[n] = eased(nodes_[n]);
  });
  std::vector<int> bent;
  for (std::size_t n = 0; n < nodes_.size(); ++n) {
    if (!found[n]) continue;
    std::swap(nodes_[n], *found[n]);
    // No branch may be left without room: that would change more of the plan than it mends.
    const bool fits = std::all_of(nodes_[n].ends.begin(), nodes_[n].ends.end(),
                                  [&](const BranchEnd& end) { return has_room(end.branch); });
    if (fits) {
      bent.push_back(static_cast<int>(n));
    } else {
      std::swap(nodes_[n], *found[n]);
    }
  }
  if (!bent.empty() && tighten()) settle();
  return bent;
}

}  // namespace angiospline
