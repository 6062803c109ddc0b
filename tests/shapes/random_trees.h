// Random vascular trees with a known graph.
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
#include "modeling/tree/centerline_tree.h"
#include "tests/shapes/small_masks.h"

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

}  // namespace angiospline::test
