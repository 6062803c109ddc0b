#include "modeling/build/make_room.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <queue>
#include <utility>

#include <fmt/format.h>

#include "base/index.h"
#include "modeling/build/rules.h"
#include "modeling/tree/keep_apart.h"

namespace angiospline {
namespace {

// 1 up to 0, 0 from 1 on, with two smooth derivatives.
double fading(double x) {
  const double y = std::clamp(x, 0.0, 1.0);
  return 1 - y * y * y * (10 - 15 * y + 6 * y * y);
}

// Nodes that are parts of one junction, and how many branches that has.
class Parts {
 public:
  explicit Parts(const std::vector<std::vector<int>>& at) : of_(at.size()), branches_(at.size()) {
    std::iota(of_.begin(), of_.end(), 0);
    for (std::size_t n = 0; n < at.size(); ++n) branches_[n] = at[n].size();
  }
  // Whether the two are one part now.
  bool join(int a, int b, std::size_t most) {
    a = find(a);
    b = find(b);
    if (a == b) return true;
    const std::size_t together = branches_[index(a)] + branches_[index(b)] - 2;
    if (together > most) return false;
    of_[index(std::max(a, b))] = std::min(a, b);
    branches_[index(std::min(a, b))] = together;
    return true;
  }

 private:
  int find(int n) {
    while (of_[index(n)] != n) n = of_[index(n)] = of_[index(of_[index(n)])];
    return n;
  }
  std::vector<int> of_;
  std::vector<std::size_t> branches_;
};

}  // namespace

RoomMaker::RoomMaker(SmoothedTree tree, const RoomOptions& options)
    : given_(std::move(tree)), options_(options), at_(branches_at_nodes(given_.tree)) {
  // The way along a branch is the integral of ds over the radius there, by the midpoint rule.
  shares_.assign(at_.size(), 1.0);
  requests_.resize(at_.size());
  for (const BSplineCurve<4>& path : given_.paths) {
    const double length = path.knots().last();
    const double mean = path.control_points().row(3).mean();
    const int count = std::max(ThinningRules::kFewestPlaces,
                               static_cast<int>(ThinningRules::kPlacesPerRadius * length / mean));
    std::vector<double> way{0.0};
    for (int k = 0; k < count; ++k) {
      way.push_back(way.back() + length / count / path.at(length * (k + 0.5) / count)(3));
    }
    ways_.push_back(std::move(way));
  }
}

bool RoomMaker::cut(const PlannedNode& node) {
  const bool is_small = node.ends.size() <= options_.most_branches;
  std::vector<AbsorbedBranch> absorbed = node.absorbed;
  std::stable_sort(
      absorbed.begin(), absorbed.end(),
      [](const AbsorbedBranch& a, const AbsorbedBranch& b) { return a.fits < b.fits; });

  // Those that lack the most stay together first.
  Parts parts(at_);
  std::vector<std::pair<int, double>> asked;
  for (const AbsorbedBranch& between : absorbed) {
    const CenterlineBranch& branch = given_.tree.branches[index(between.branch)];
    if (!is_small && parts.join(branch.from, branch.to, options_.most_branches)) continue;
    const double factor = std::clamp(ThinningRules::kSpare * between.fits,
                                     ThinningRules::kMostAtOnce, ThinningRules::kSpare);
    for (const int n : {branch.from, branch.to}) {
      asked.emplace_back(n, std::max(options_.thinnest, factor * shares_[index(n)]));
    }
  }

  bool thinner = false;
  for (const auto& [n, share] : asked) {
    if (share >= shares_[index(n)] - ThinningRules::kWorthNaming) continue;
    thinner = true;
    shares_[index(n)] = share;
  }
  return thinner;
}

// The nodes that are less than the reach of thinning away from this one, in local radii of way.
std::vector<std::pair<int, double>> RoomMaker::near(int node) const {
  // Dijkstra's algorithm, stopped at the reach.
  std::vector<std::pair<int, double>> found;
  using Entry = std::pair<double, int>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  open.emplace(0.0, node);
  while (!open.empty()) {
    const auto [away, n] = open.top();
    open.pop();
    const auto is_same = [m = n](const auto& entry) { return entry.first == m; };
    if (std::any_of(found.begin(), found.end(), is_same)) continue;
    found.emplace_back(n, away);

    for (const int b : at_[index(n)]) {
      const CenterlineBranch& branch = given_.tree.branches[index(b)];
      const double there = away + ways_[index(b)].back();
      if (there < ThinningRules::kFullRadii + ThinningRules::kFadeRadii) {
        open.emplace(there, branch.from == n ? branch.to : branch.from);
      }
    }
  }
  return found;
}

// The least that any node asks for.
double RoomMaker::share_at(std::size_t b, double along) const {
  const CenterlineBranch& branch = given_.tree.branches[b];
  const std::vector<double>& ways = ways_[b];
  const double length = given_.paths[b].knots().last();
  const double x = std::clamp(along / length, 0.0, 1.0) * static_cast<double>(ways.size() - 1);
  const auto k = std::min(static_cast<std::size_t>(x), ways.size() - 2);
  const double way = ways[k] + (x - static_cast<double>(k)) * (ways[k + 1] - ways[k]);

  double least = 1;
  for (const auto& [node, gone] : {std::pair{branch.from, way}, {branch.to, ways.back() - way}}) {
    for (const Request& request : requests_[index(node)]) {
      const double weight =
          fading((request.away + gone - ThinningRules::kFullRadii) / ThinningRules::kFadeRadii);
      least = std::min(least, 1 - weight * (1 - request.share));
    }
  }
  return least;
}

void RoomMaker::thin(std::size_t b, SmoothedTree& tree) const {
  const BSplineCurve<4> fine = with_knots_each_radius(given_.paths[b]);
  Eigen::Matrix4Xd points = fine.control_points();
  double kept = 1;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const double share = share_at(b, fine.knots().greville(static_cast<int>(i)));
    points(3, i) *= share;
    kept = std::min(kept, share);
  }
  if (kept > 1 - ThinningRules::kWorthNaming) return;
  tree.paths[b] = BSplineCurve<4>(fine.knots(), std::move(points));

  // The tree's own radii too, so that what is smoothed again is as thin.
  CenterlineBranch& branch = tree.tree.branches[b];
  const double scale = fine.knots().last() / length_mm(branch);
  double along = 0;
  for (Eigen::Index i = 0; i < branch.radii_mm.size(); ++i) {
    if (i > 0) along += (branch.points_mm.col(i) - branch.points_mm.col(i - 1)).norm();
    branch.radii_mm(i) *= share_at(b, scale * along);
  }

  tree.warnings.push_back(
      {WarningCode::kThinnedForJunctions,
       fmt::format("branch {} was thinned to {:.0f} % so that the junctions near it have room",
                   branch.name, 100 * kept)});
}

SmoothedTree RoomMaker::tree() {
  for (std::vector<Request>& requests : requests_) requests.clear();
  for (std::size_t n = 0; n < shares_.size(); ++n) {
    if (shares_[n] >= 1) continue;
    for (const auto& [node, away] : near(static_cast<int>(n))) {
      requests_[index(node)].push_back({shares_[n], away});
    }
  }

  SmoothedTree tree = given_;
  for (std::size_t b = 0; b < tree.paths.size(); ++b) {
    const CenterlineBranch& branch = tree.tree.branches[b];
    if (!requests_[index(branch.from)].empty() || !requests_[index(branch.to)].empty()) {
      thin(b, tree);
    }
  }
  return tree;
}

}  // namespace angiospline
