// Random vascular trees with a known graph, and how well a recovered tree matches one.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "base/random.h"
#include "modeling/centerline_tree.h"
#include "tests/recovery/small_masks.h"

namespace angiospline::test {

// A tree of curved branches: CenterlineTree with constant radii, inlet node 0.
struct RandomTreeOptions {
  double extent_mm = 120.0;  // of the cube the tree stays in
  double root_radius_mm = 8.0;
  double least_radius_mm = 2.0;  // no branch is thinner
  int most_branches = 31;
  double gap_mm = 4.0;  // between walls of branches that do not meet
};

class RandomTree {
 public:
  RandomTree(const RandomTreeOptions& options, Random& random) : o_(options), random_(random) {}

  CenterlineTree grow() {
    const double m = o_.root_radius_mm + 3.0;
    tree_.nodes.push_back({"n0", Vec3(0.5 * o_.extent_mm, 0.5 * o_.extent_mm, m)});
    tree_.inlets = {0};
    std::vector<Tip> tips;
    if (const auto tip = add({0, Vec3::UnitZ(), o_.root_radius_mm, -1})) tips.push_back(*tip);
    for (std::size_t head = 0; head < tips.size(); ++head) {
      if (static_cast<int>(tree_.branches.size()) + 2 > o_.most_branches) break;
      fork(tips[head], tips);
    }
    return std::move(tree_);
  }

 private:
  struct Tip {
    int node;
    Vec3 direction;
    double radius;
    int parent;  // branch
  };

  // Two daughters or none.
  void fork(const Tip& tip, std::vector<Tip>& tips) {
    for (int attempt = 0; attempt < 20; ++attempt) {
      const double share = random_.uniform(0.35, 0.65);
      const double r1 = tip.radius * std::cbrt(share);
      const double r2 = tip.radius * std::cbrt(1.0 - share);
      if (std::min(r1, r2) < o_.least_radius_mm) return;
      const Vec3 side = tip.direction.cross(random_unit()).normalized();
      const double a1 = random_.uniform(0.45, 0.8);
      const double a2 = random_.uniform(0.45, 0.8);
      const CenterlineTree before = tree_;
      const auto first =
          add({tip.node, std::cos(a1) * tip.direction + std::sin(a1) * side, r1, tip.parent});
      const auto second =
          first
              ? add({tip.node, std::cos(a2) * tip.direction - std::sin(a2) * side, r2, tip.parent})
              : std::nullopt;
      if (first && second) {
        tips.push_back(*first);
        tips.push_back(*second);
        return;
      }
      tree_ = before;
    }
  }

  Vec3 random_unit() {
    return Vec3(random_.gaussian(), random_.gaussian(), random_.gaussian()).normalized();
  }

  std::optional<Tip> add(const Tip& from) {
    const double length = from.radius * random_.uniform(4.0, 7.0) + 8.0;
    const Vec3 bend = 0.25 * from.direction.cross(random_unit());
    std::vector<Vec3> points{tree_.nodes[static_cast<std::size_t>(from.node)].position_mm};
    Vec3 direction = from.direction;
    const int steps = static_cast<int>(length);
    for (int i = 0; i < steps; ++i) {
      direction = (direction + bend / steps).normalized();
      points.push_back(points.back() + length / steps * direction);
    }
    if (!fits(points, from)) return std::nullopt;
    CenterlineBranch branch;
    branch.from = from.node;
    branch.to = static_cast<int>(tree_.nodes.size());
    branch.points_mm.resize(3, static_cast<Eigen::Index>(points.size()));
    for (std::size_t i = 0; i < points.size(); ++i)
      branch.points_mm.col(static_cast<Eigen::Index>(i)) = points[i];
    branch.radii_mm =
        Eigen::VectorXd::Constant(static_cast<Eigen::Index>(points.size()), from.radius);
    tree_.nodes.push_back({"n", points.back()});
    tree_.branches.push_back(std::move(branch));
    return Tip{static_cast<int>(tree_.nodes.size()) - 1, direction, from.radius,
               static_cast<int>(tree_.branches.size()) - 1};
  }

  bool fits(const std::vector<Vec3>& points, const Tip& from) const {
    const double margin = from.radius + 2.0;
    for (const Vec3& p : points)
      if (p.minCoeff() < margin || p.maxCoeff() > o_.extent_mm - margin) return false;
    const Vec3 start = points.front();
    for (std::size_t b = 0; b < tree_.branches.size(); ++b) {
      const CenterlineBranch& other = tree_.branches[b];
      const double touching = from.radius + other.radii_mm[0] + o_.gap_mm;
      const bool meets = other.from == from.node || other.to == from.node;
      for (const Vec3& p : points) {
        // Where branches meet they overlap; beyond three radii they have to be apart.
        if (meets && (p - start).norm() < 3.0 * std::max(from.radius, other.radii_mm[0])) continue;
        for (Eigen::Index k = 0; k < other.points_mm.cols(); ++k)
          if ((other.points_mm.col(k) - p).norm() < touching) return false;
      }
    }
    return true;
  }

  RandomTreeOptions o_;
  Random& random_;
  CenterlineTree tree_;
};

inline void paint(Mask& mask, const CenterlineTree& tree) {
  for (const CenterlineBranch& b : tree.branches)
    for (Eigen::Index i = 0; i + 1 < b.points_mm.cols(); ++i)
      add_tube(mask, b.points_mm.col(i), b.points_mm.col(i + 1), b.radii_mm[i]);
}

// Of truth and found: how many there are and how many were paired.
struct Match {
  int truth = 0;
  int found = 0;
  int paired = 0;
  double f1() const { return truth + found == 0 ? 1.0 : 2.0 * paired / (truth + found); }
  Match& operator+=(const Match& m) {
    truth += m.truth;
    found += m.found;
    paired += m.paired;
    return *this;
  }
};

struct TreeMatch {
  Match ends, junctions, branches;
  double worst_tip_lost_mm =
      0.0;  // how far a paired end falls short of the true one, along the branch
};

// Ends are paired within `reach` true radii and junctions too (at least 3 mm), nearest first;
// branches when both nodes are paired with the nodes of one true branch.
inline TreeMatch match(const CenterlineTree& truth, const CenterlineTree& found,
                       double reach = 1.5) {
  const auto at_truth = branches_at_nodes(truth);
  const auto at_found = branches_at_nodes(found);
  TreeMatch result;
  std::vector<int> partner(truth.nodes.size(), -1);
  for (const bool ends : {true, false}) {
    Match& m = ends ? result.ends : result.junctions;
    struct Pair {
      double distance;
      std::size_t t, f;
    };
    std::vector<Pair> pairs;
    for (std::size_t t = 0; t < truth.nodes.size(); ++t)
      m.truth += (at_truth[t].size() == 1) == ends;
    for (std::size_t f = 0; f < found.nodes.size(); ++f)
      m.found += (at_found[f].size() == 1) == ends;
    for (std::size_t t = 0; t < truth.nodes.size(); ++t) {
      if ((at_truth[t].size() == 1) != ends) continue;
      double radius = 0.0;
      for (const int b : at_truth[t])
        radius = std::max(radius, truth.branches[static_cast<std::size_t>(b)].radii_mm[0]);
      for (std::size_t f = 0; f < found.nodes.size(); ++f) {
        if ((at_found[f].size() == 1) != ends) continue;
        const double d = (truth.nodes[t].position_mm - found.nodes[f].position_mm).norm();
        if (d <= std::max(3.0, reach * radius)) pairs.push_back({d, t, f});
      }
    }
    std::sort(pairs.begin(), pairs.end(),
              [](const Pair& a, const Pair& b) { return a.distance < b.distance; });
    std::vector<bool> taken(found.nodes.size(), false);
    for (const Pair& p : pairs) {
      if (partner[p.t] >= 0 || taken[p.f]) continue;
      partner[p.t] = static_cast<int>(p.f);
      taken[p.f] = true;
      ++m.paired;
      if (!ends) continue;
      const CenterlineBranch& b = truth.branches[static_cast<std::size_t>(at_truth[p.t][0])];
      const bool last = b.to == static_cast<int>(p.t);
      const Eigen::Index n = b.points_mm.cols();
      const Vec3 tip = b.points_mm.col(last ? n - 1 : 0);
      const Vec3 out = (tip - b.points_mm.col(last ? n - 2 : 1)).normalized();
      result.worst_tip_lost_mm =
          std::max(result.worst_tip_lost_mm, (tip - found.nodes[p.f].position_mm).dot(out));
    }
  }
  std::vector<std::pair<int, int>> joined;
  for (const CenterlineBranch& b : found.branches)
    joined.emplace_back(std::min(b.from, b.to), std::max(b.from, b.to));
  result.branches.truth = static_cast<int>(truth.branches.size());
  result.branches.found = static_cast<int>(found.branches.size());
  for (const CenterlineBranch& b : truth.branches) {
    const std::pair<int, int> pair = std::minmax(
        {partner[static_cast<std::size_t>(b.from)], partner[static_cast<std::size_t>(b.to)]});
    const auto at = std::find(joined.begin(), joined.end(), pair);
    if (pair.first < 0 || at == joined.end()) continue;
    joined.erase(at);
    ++result.branches.paired;
  }
  return result;
}

// Distances from found centerline points to the true centerline, and relative errors of the radius,
// over points farther than `clear` radii from every true node (what a junction's middle is, is a
// matter of taste).
struct CenterlineErrors {
  double mean_mm = 0.0;
  double worst_mm = 0.0;
  double radius_bias = 0.0;  // mean of found / true - 1
  int points = 0;
};

inline CenterlineErrors centerline_errors(const CenterlineTree& truth, const CenterlineTree& found,
                                          double clear = 2.0) {
  CenterlineErrors e;
  for (const CenterlineBranch& f : found.branches)
    for (Eigen::Index i = 0; i < f.points_mm.cols(); ++i) {
      const Vec3 p = f.points_mm.col(i);
      double best = std::numeric_limits<double>::infinity();
      double radius = 0.0;
      for (const CenterlineBranch& t : truth.branches)
        for (Eigen::Index k = 0; k + 1 < t.points_mm.cols(); ++k) {
          const Vec3 a = t.points_mm.col(k);
          const Vec3 ab = t.points_mm.col(k + 1) - a;
          const double s = std::clamp((p - a).dot(ab) / ab.squaredNorm(), 0.0, 1.0);
          const double d = (p - a - s * ab).norm();
          if (d < best) {
            best = d;
            radius = t.radii_mm[k];
          }
        }
      bool near = false;
      for (const CenterlineNode& n : truth.nodes)
        near = near || (n.position_mm - p).norm() < clear * radius;
      if (near) continue;
      e.mean_mm += best;
      e.worst_mm = std::max(e.worst_mm, best);
      e.radius_bias += f.radii_mm[i] / radius - 1.0;
      ++e.points;
    }
  if (e.points > 0) {
    e.mean_mm /= e.points;
    e.radius_bias /= e.points;
  }
  return e;
}

}  // namespace angiospline::test
