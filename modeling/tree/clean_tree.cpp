#include "modeling/tree/clean_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "base/disjoint_sets.h"
#include "base/index.h"
#include "modeling/tree/rules.h"

namespace angiospline {
namespace {

void drop_repeated_points(CenterlineBranch& branch) {
  const Eigen::Index count = branch.points_mm.cols();
  Eigen::Index kept = 1;
  for (Eigen::Index i = 1; i < count; ++i) {
    const double step = (branch.points_mm.col(i) - branch.points_mm.col(kept - 1)).norm();
    const double same =
        CleaningRules::kSamePoint * std::min(branch.radii_mm(i), branch.radii_mm(kept - 1));
    if (step <= same) {
      if (i + 1 < count) continue;
      if (kept > 1) --kept;  // the last point is the node's: it replaces its copy
    }
    branch.points_mm.col(kept) = branch.points_mm.col(i);
    branch.radii_mm(kept++) = branch.radii_mm(i);
  }

  branch.points_mm.conservativeResize(3, kept);
  branch.radii_mm.conservativeResize(kept);
}

// Where the course turns back twice within a few radii, the points between are put in the opposite
// order if that shortens the way: a tracer or a rounding exchanged them. A hairpin stays, for its
// legs are longer the other way round. Returns how many were put in order.
int put_in_order(CenterlineBranch& branch) {
  Points3& p = branch.points_mm;
  const Eigen::Index count = p.cols();
  const auto turns_back = [&](Eigen::Index i) {
    return (p.col(i) - p.col(i - 1)).dot(p.col(i + 1) - p.col(i)) < 0;
  };
  const auto step = [&](Eigen::Index i, Eigen::Index j) { return (p.col(j) - p.col(i)).norm(); };

  int reversed = 0;
  for (int pass = 0; pass < CleaningRules::kReversalPasses; ++pass) {
    const int before = reversed;
    for (Eigen::Index i = 1; i + 2 < count; ++i) {
      if (!turns_back(i)) continue;
      double way = 0;
      for (Eigen::Index j = i + 1; j < std::min(i + CleaningRules::kMostReversed, count - 1); ++j) {
        way += step(j - 1, j);
        if (way > CleaningRules::kReversedWay * branch.radii_mm(i)) break;
        const double now = step(i - 1, i) + step(j, j + 1);
        const double then = step(i - 1, j) + step(i, j + 1);
        if (!turns_back(j) || then + way >= CleaningRules::kWorthReversing * (now + way)) continue;

        const Eigen::Index width = j - i + 1;
        p.middleCols(i, width) = p.middleCols(i, width).rowwise().reverse().eval();
        branch.radii_mm.segment(i, width) = branch.radii_mm.segment(i, width).reverse().eval();
        reversed += static_cast<int>(width);
        break;
      }
    }
    if (reversed == before) break;
  }
  return reversed;
}

void reverse(CenterlineBranch& branch) {
  std::swap(branch.from, branch.to);
  branch.points_mm = branch.points_mm.rowwise().reverse().eval();
  branch.radii_mm = branch.radii_mm.reverse().eval();
}

// Whether p lies inside the tube of the branch, within `reach` of arc length from its end at
// `node`.
bool inside_lumen(const Vec3& p, const CenterlineBranch& branch, bool from_start, double reach) {
  const Eigen::Index count = branch.points_mm.cols();
  double walked = 0;
  for (Eigen::Index k = 0; k + 1 < count && walked <= reach; ++k) {
    const Eigen::Index i = from_start ? k : count - 1 - k;
    const Eigen::Index j = from_start ? k + 1 : count - 2 - k;

    // The radius is linear along a segment, as the tube is.
    const Vec3 a = branch.points_mm.col(i);
    const Vec3 d = branch.points_mm.col(j) - a;
    const double length = d.norm();
    walked += length;
    if (!(length > 0)) continue;
    const double t = std::clamp((p - a).dot(d) / (length * length), 0.0, 1.0);
    const double r = (1 - t) * branch.radii_mm(i) + t * branch.radii_mm(j);
    if ((p - a - t * d).norm() < r) return true;
  }
  return false;
}

// ---------------------------------------------------------------- rounding

// The step to which a number of this size is rounded.
double step_of(double length) {
  return std::ldexp(1.0, std::ilogb(length * CleaningRules::kOffRoundLengths) - kKeptBits);
}

double to_step(double value, double step) {
  const double rounded = std::nearbyint(value / step) * step;
  return std::isfinite(rounded) ? rounded : value;
}

// ---------------------------------------------------------------- cleaning

class Cleaner {
 public:
  explicit Cleaner(const CenterlineTree& tree) : tree_(tree), alive_(tree.branches.size(), true) {}

  CleanedTree clean() {
    // What has no radius or length first: all that follows measures by them.
    leave_out_branches_without_radius();
    for (CenterlineBranch& branch : tree_.branches) drop_repeated_points(branch);
    contract_branches_without_length();

    // A spur that goes may leave a chain, and a chain that was joined may be a spur.
    join_chains();
    for (int pass = 0; pass < CleaningRules::kSpurPasses && drop_spurs(); ++pass) join_chains();

    for (CenterlineBranch& branch : tree_.branches) {
      if (const int points = put_in_order(branch); points > 0) {
        warnings_.push_back(
            {WarningCode::kPointsReordered,
             fmt::format("branch {}: {} points that lead back and forth were taken in the order of "
                         "the shorter way",
                         branch.name, points)});
      }
    }
    CleanedTree cleaned{std::move(tree_), {}};
    cleaned.warnings = std::move(warnings_);
    return cleaned;
  }

 private:
  std::vector<std::vector<int>> branches_at() const {
    std::vector<std::vector<int>> at(tree_.nodes.size());
    for (std::size_t b = 0; b < tree_.branches.size(); ++b) {
      if (!alive_[b]) continue;
      at[index(tree_.branches[b].from)].push_back(static_cast<int>(b));
      at[index(tree_.branches[b].to)].push_back(static_cast<int>(b));
    }
    return at;
  }

  void leave_out_branches_without_radius() {
    for (std::size_t b = 0; b < tree_.branches.size(); ++b) {
      const CenterlineBranch& branch = tree_.branches[b];
      const auto& r = branch.radii_mm;
      const auto bad = std::find_if(
          r.begin(), r.end(), [](double value) { return !(value > 0 && std::isfinite(value)); });
      if (bad == r.end()) continue;

      alive_[b] = false;
      warnings_.push_back(
          {WarningCode::kBadRadius,
           fmt::format(
               "branch {} ({} to {}), point {}: radius is not positive: {} (radii are positive and "
               "finite): left out",
               branch.name, tree_.nodes[index(branch.from)].name,
               tree_.nodes[index(branch.to)].name, bad - r.begin(), *bad)});
    }
  }

  void contract_branches_without_length() {
    DisjointSets nodes(tree_.nodes.size());
    for (std::size_t b = 0; b < tree_.branches.size(); ++b) {
      if (!alive_[b]) continue;
      const CenterlineBranch& branch = tree_.branches[b];
      // After dropping repeats, two points closer than the tolerance are left of a branch without
      // length.
      const bool has_length = branch.points_mm.cols() > 2 ||
                              (branch.points_mm.cols() == 2 &&
                               (branch.points_mm.col(1) - branch.points_mm.col(0)).norm() >
                                   CleaningRules::kSamePoint * branch.radii_mm.minCoeff());
      if (has_length) continue;
      alive_[b] = false;
      nodes.join(branch.from, branch.to);
      warnings_.push_back({WarningCode::kBranchWithoutLength,
                           fmt::format("branch {} has no length: dropped", branch.name)});
    }

    for (CenterlineBranch& branch : tree_.branches) {
      branch.from = nodes.root(branch.from);
      branch.to = nodes.root(branch.to);
      branch.points_mm.col(0) = tree_.nodes[index(branch.from)].position_mm;
      branch.points_mm.rightCols(1) = tree_.nodes[index(branch.to)].position_mm;
    }
    for (int& inlet : tree_.inlets) inlet = nodes.root(inlet);
  }

  bool drop_spurs() {
    const auto at = branches_at();
    std::vector<int> degree(tree_.nodes.size());
    for (std::size_t n = 0; n < at.size(); ++n) degree[n] = static_cast<int>(at[n].size());
    std::vector<std::pair<double, int>> spurs;
    for (std::size_t b = 0; b < tree_.branches.size(); ++b) {
      if (alive_[b] && is_spur(static_cast<int>(b), at)) {
        spurs.emplace_back(length_mm(tree_.branches[b]), static_cast<int>(b));
      }
    }

    // The shortest first: where it goes a longer one may be needed to make a junction.
    std::sort(spurs.begin(), spurs.end());
    bool dropped = false;
    for (const auto& [length, b] : spurs) {
      const CenterlineBranch& branch = tree_.branches[index(b)];
      const int node = at[index(branch.from)].size() == 1 ? branch.to : branch.from;
      if (degree[index(node)] < 3) continue;
      --degree[index(node)];
      alive_[index(b)] = false;
      dropped = true;
      warnings_.push_back(
          {WarningCode::kBranchInsideLumen,
           fmt::format("branch {} ends inside the lumen it leaves (length {:.3g} mm): dropped",
                       branch.name, length)});
    }
    return dropped;
  }

  bool is_spur(int b, const std::vector<std::vector<int>>& at) const {
    const CenterlineBranch& branch = tree_.branches[index(b)];
    const bool ends_at_from = at[index(branch.from)].size() == 1;
    if (ends_at_from == (at[index(branch.to)].size() == 1)) return false;
    const int node = ends_at_from ? branch.to : branch.from;
    if (at[index(node)].size() < 3) return false;

    // Inside the tube of another branch that is as thick somewhere, no farther along it than the
    // spur is long, twice: a vessel that leaves and comes near again is none.
    const Eigen::Index tip = ends_at_from ? 0 : branch.points_mm.cols() - 1;
    const double reach = 2 * length_mm(branch);
    for (const int other : at[index(node)]) {
      const CenterlineBranch& o = tree_.branches[index(other)];
      if (other == b || branch.radii_mm(tip) > o.radii_mm.maxCoeff()) continue;
      if (o.from == node && inside_lumen(branch.points_mm.col(tip), o, true, reach)) return true;
      if (o.to == node && inside_lumen(branch.points_mm.col(tip), o, false, reach)) return true;
    }
    return false;
  }

  void join_chains() {
    const auto at = branches_at();
    names_.clear();
    CenterlineTree out;
    out.source = tree_.source;
    out.assumptions = tree_.assumptions;
    new_node_.assign(tree_.nodes.size(), -1);
    for (std::size_t n = 0; n < tree_.nodes.size(); ++n) {
      if (!at[n].empty() && at[n].size() != 2) keep_node(static_cast<int>(n), out);
    }

    // Chains that begin at a node, those against their direction last; then rings.
    std::vector<bool> done(tree_.branches.size(), false);
    for (std::size_t b = 0; b < tree_.branches.size(); ++b) {
      if (!alive_[b] || done[b] || new_node_[index(tree_.branches[b].from)] < 0) continue;
      walk(static_cast<int>(b), true, at, done, out);
    }
    for (std::size_t b = 0; b < tree_.branches.size(); ++b) {
      if (!alive_[b] || done[b] || new_node_[index(tree_.branches[b].to)] < 0) continue;
      walk(static_cast<int>(b), false, at, done, out);
    }
    for (std::size_t b = 0; b < tree_.branches.size(); ++b) {
      if (!alive_[b] || done[b]) continue;
      keep_node(tree_.branches[b].from, out);
      walk(static_cast<int>(b), true, at, done, out);
    }

    replace_inlets(out);
    tree_ = std::move(out);
    alive_.assign(tree_.branches.size(), true);
  }

  void keep_node(int n, CenterlineTree& out) {
    new_node_[index(n)] = static_cast<int>(out.nodes.size());
    out.nodes.push_back(tree_.nodes[index(n)]);
  }

  // Joins the chain that starts with branch b, along it or against it, up to the next kept node.
  void walk(int b, bool along, const std::vector<std::vector<int>>& at, std::vector<bool>& done,
            CenterlineTree& out) {
    std::vector<std::pair<int, bool>> chain;
    const int start = along ? tree_.branches[index(b)].from : tree_.branches[index(b)].to;
    int here = start;
    int forward = 0;
    while (true) {
      const CenterlineBranch& branch = tree_.branches[index(b)];
      done[index(b)] = true;
      const bool is_along = branch.from == here;
      chain.emplace_back(b, is_along);
      forward += is_along ? 1 : -1;
      here = is_along ? branch.to : branch.from;
      if (new_node_[index(here)] >= 0) break;
      const auto& two = at[index(here)];
      b = two[0] == b ? two[1] : two[0];
    }

    // It runs the way most of its parts do, and bears the names of its new ends if it is more than
    // one and nobody else does.
    CenterlineBranch joined = joined_branch(chain);
    joined.from = new_node_[index(start)];
    joined.to = new_node_[index(here)];
    if (forward < 0) reverse(joined);
    joined.name = tree_.branches[index(chain.front().first)].name;
    if (chain.size() > 1) {
      const std::string name =
          out.nodes[index(joined.from)].name + "_" + out.nodes[index(joined.to)].name;
      if (names_.insert(name).second) joined.name = name;
    }
    names_.insert(joined.name);
    out.branches.push_back(std::move(joined));
  }

  CenterlineBranch joined_branch(const std::vector<std::pair<int, bool>>& chain) const {
    Eigen::Index count = 1;
    for (const auto& [b, along] : chain) count += tree_.branches[index(b)].points_mm.cols() - 1;
    CenterlineBranch joined;
    joined.points_mm.resize(3, count);
    joined.radii_mm.resize(count);

    // Parts share the point between them.
    Eigen::Index filled = 0;
    for (const auto& [b, along] : chain) {
      const CenterlineBranch& part = tree_.branches[index(b)];
      const Eigen::Index n = part.points_mm.cols();
      for (Eigen::Index k = filled == 0 ? 0 : 1; k < n; ++k) {
        const Eigen::Index i = along ? k : n - 1 - k;
        joined.points_mm.col(filled) = part.points_mm.col(i);
        joined.radii_mm(filled++) = part.radii_mm(i);
      }
    }
    return joined;
  }

  void replace_inlets(CenterlineTree& out) const {
    const auto at = branches_at_nodes(out);
    const auto component = components_of_nodes(out);
    std::vector<bool> has_inlet(out.nodes.size(), false);
    std::set<int> inlets;
    for (const int old : tree_.inlets) {
      const int n = new_node_[index(old)];
      if (n < 0 || at[index(n)].size() != 1) continue;
      inlets.insert(n);
      has_inlet[index(component[index(n)])] = true;
    }

    // Components that lost theirs get the widest end, but only in a tree that had inlets at all.
    if (!tree_.inlets.empty()) {
      std::vector<std::pair<double, int>> widest(out.nodes.size(), {0.0, -1});
      for (std::size_t n = 0; n < out.nodes.size(); ++n) {
        if (at[n].size() != 1 || has_inlet[index(component[n])]) continue;
        const CenterlineBranch& branch = out.branches[index(at[n][0])];
        const bool starts = branch.from == static_cast<int>(n);
        const double r = branch.radii_mm(starts ? 0 : branch.radii_mm.size() - 1);
        auto& best = widest[index(component[n])];
        if (r > best.first) best = {r, static_cast<int>(n)};
      }
      for (const auto& [r, n] : widest) {
        if (n >= 0) inlets.insert(n);
      }
    }
    out.inlets.assign(inlets.begin(), inlets.end());
  }

  CenterlineTree tree_;
  std::vector<bool> alive_;
  std::vector<int> new_node_;
  std::set<std::string> names_;
  std::vector<Warning> warnings_;
};

}  // namespace

CleanedTree clean_tree(const CenterlineTree& tree) { return Cleaner(tree).clean(); }

CenterlineTree rounded(CenterlineTree tree) {
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity());
  Vec3 high = -low;
  for (const CenterlineBranch& branch : tree.branches) {
    low = low.cwiseMin(branch.points_mm.rowwise().minCoeff());
    high = high.cwiseMax(branch.points_mm.rowwise().maxCoeff());
  }

  const double extent = (high - low).maxCoeff();
  if (!(extent > 0) || !std::isfinite(extent)) return tree;
  const double step = step_of(extent);

  // Coordinates to one grid, radii each to its own digits: a small radius keeps as many.
  const auto on_grid = [step](double x) { return to_step(x, step); };
  for (CenterlineNode& node : tree.nodes) node.position_mm = node.position_mm.unaryExpr(on_grid);
  for (CenterlineBranch& branch : tree.branches) {
    branch.points_mm = branch.points_mm.unaryExpr(on_grid).eval();
    for (double& radius : branch.radii_mm) {
      if (radius > 0 && std::isfinite(radius)) radius = to_step(radius, step_of(radius));
    }
  }
  return tree;
}

}  // namespace angiospline
