// How well a recovered tree matches the one it was made of.
#pragma once

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "modeling/tree/centerline_tree.h"

namespace angiospline::test {

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
