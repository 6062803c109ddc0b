#include "modeling/keep_apart.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "base/contract.h"
#include "kernel/refinement.h"
#include "modeling/overlaps.h"

namespace angiospline {
namespace {

constexpr int kMoveRounds = 16;
constexpr int kThinRounds = 12;
constexpr double kMoveWidth = 4.0;  // radii to either side of a contact
constexpr double kThinWidth = 3.0;
constexpr double kHeldRadii = 2.0;   // of a branch at a junction that stay where they are
constexpr double kOvershoot = 1.15;  // of a step: what is smoothed over a width falls short
constexpr double kKnotStep = 1.0;    // radii between knots of a path that moves
constexpr double kAim = 0.02;        // radii beyond the clearance
constexpr double kWorthNaming = 1e-3;

std::size_t index(int i) { return static_cast<std::size_t>(i); }

// 1 at 0, 0 from 1 on, with two smooth derivatives.
double bump(double x) {
  const double y = std::min(1.0, std::abs(x));
  return 1 - y * y * y * (10 - 15 * y + 6 * y * y);
}

// What one branch is asked to do, at its control points.
struct Request {
  Eigen::Matrix3Xd moves;
  Eigen::VectorXd weights;
  Eigen::VectorXd shares;  // of the radius that is kept
};

class Separator {
 public:
  Separator(SmoothedTree& tree, const KeepApartOptions& options)
      : tree_(tree), options_(options), original_(tree.paths) {
    std::vector<int> degree(tree.tree.nodes.size(), 0);
    for (const CenterlineBranch& branch : tree.tree.branches) {
      ++degree[index(branch.from)];
      ++degree[index(branch.to)];
    }
    for (std::size_t b = 0; b < tree.paths.size(); ++b) {
      const CenterlineBranch& branch = tree.tree.branches[b];
      joined_.push_back({degree[index(branch.from)] > 1, degree[index(branch.to)] > 1});
      held_.push_back(held_part(tree.paths[b], joined_[b][0], joined_[b][1]));
    }
  }

  void run() {
    const OverlapOptions asked{options_.clearance};
    refine_paths(find_contacts(tree_, asked));
    // Steps aim a little beyond, or they would come ever nearer and never arrive.
    const OverlapOptions aimed{options_.clearance + kAim};
    for (int round = 0; round < kMoveRounds && !find_contacts(tree_, asked).empty(); ++round) {
      if (!move(find_contacts(tree_, aimed))) break;
    }
    for (int round = 0; round < kThinRounds && !find_contacts(tree_, asked).empty(); ++round) {
      if (!thin(find_contacts(tree_, aimed))) break;
    }
    name_changes();
    for (const Overlap& left : find_overlaps(tree_, asked)) {
      const double radius = tree_.tree.branches[index(left.first)].radii_mm.mean();
      if (left.depth_mm <= kWorthNaming * radius) continue;
      tree_.warnings.push_back(fmt::format(
          "{} and {} stay too near each other: {:.3g} mm are missing to a clearance of "
          "{:.3g} radii near ({:.4g}, {:.4g}, {:.4g})",
          tree_.tree.branches[index(left.first)].name, tree_.tree.branches[index(left.second)].name,
          left.depth_mm, options_.clearance, left.at_mm.x(), left.at_mm.y(), left.at_mm.z()));
    }
  }

 private:
  // A straight path may have a handful of control points: bumps need some to every radius.
  void refine_paths(const std::vector<VesselContact>& contacts) {
    std::vector<char> touched(tree_.paths.size(), 0);
    for (const VesselContact& c : contacts) {
      touched[index(c.first)] = touched[index(c.second)] = 1;
    }
    for (std::size_t b = 0; b < touched.size(); ++b) {
      if (touched[b] == 0) continue;
      const BSplineCurve<4>& path = tree_.paths[b];
      const double step = kKnotStep * path.control_points().row(3).mean();
      std::vector<double> added;
      const std::vector<double> breaks = path.knots().breakpoints();
      for (std::size_t k = 0; k + 1 < breaks.size(); ++k) {
        const int pieces = static_cast<int>(std::ceil((breaks[k + 1] - breaks[k]) / step));
        for (int i = 1; i < pieces; ++i) {
          added.push_back(breaks[k] + (breaks[k + 1] - breaks[k]) * i / pieces);
        }
      }
      if (added.empty()) continue;
      tree_.paths[b] = insert_knots(path, added).value();
      original_[b] = tree_.paths[b];
      held_[b] = held_part(tree_.paths[b], joined_[b][0], joined_[b][1]);
    }
  }

  // How free each control point is to move: 0 near junctions.
  Eigen::VectorXd held_part(const BSplineCurve<4>& path, bool first, bool last) const {
    const Eigen::Index count = path.control_points().cols();
    Eigen::VectorXd freedom = Eigen::VectorXd::Ones(count);
    const double length = path.knots().last();
    for (Eigen::Index i = 0; i < count; ++i) {
      const double at = path.knots().greville(static_cast<int>(i));
      const double width = kHeldRadii * path.control_points()(3, i);
      if (first) freedom(i) *= 1 - bump(std::max(0.0, at - width) / width);
      if (last) freedom(i) *= 1 - bump(std::max(0.0, length - at - width) / width);
    }
    return freedom;
  }

  double radius_at(int branch, double along) const {
    return tree_.paths[index(branch)].at(along)(3);
  }

  // The direction in which the second vessel leaves the first; of crossing centerlines, across
  // both.
  Vec3 apart(const VesselContact& c) const {
    const Vec3 way = c.second_mm - c.first_mm;
    const double radius = radius_at(c.first, c.first_along);
    if (way.norm() > 1e-3 * radius) return way.normalized();
    const Vec3 a = tree_.paths[index(c.first)].at(c.first_along, 1).head<3>().normalized();
    const Vec3 b = tree_.paths[index(c.second)].at(c.second_along, 1).head<3>().normalized();
    const Vec3 across = a.cross(b);
    return across.norm() > 1e-3 ? across.normalized() : a.unitOrthogonal();
  }

  template <typename Act>
  void for_near(int branch, double along, double width, const Act& act) const {
    const KnotVector& knots = tree_.paths[index(branch)].knots();
    for (int i = 0; i < knots.control_point_count(); ++i) {
      const double x = (knots.greville(i) - along) / width;
      if (std::abs(x) < 1) act(static_cast<Eigen::Index>(i), bump(x));
    }
  }

  std::vector<Request> requests() const {
    std::vector<Request> all(tree_.paths.size());
    return all;
  }
  Request& prepared(std::vector<Request>& all, int branch) const {
    Request& request = all[index(branch)];
    if (request.weights.size() == 0) {
      const Eigen::Index count = tree_.paths[index(branch)].control_points().cols();
      request.moves = Eigen::Matrix3Xd::Zero(3, count);
      request.weights = Eigen::VectorXd::Zero(count);
      request.shares = Eigen::VectorXd::Ones(count);
    }
    return request;
  }

  // False when nothing can move any farther.
  bool move(const std::vector<VesselContact>& contacts) {
    std::vector<Request> all = requests();
    for (const VesselContact& c : contacts) {
      const double r1 = radius_at(c.first, c.first_along);
      const double r2 = radius_at(c.second, c.second_along);
      const Vec3 step = kOvershoot * c.depth_mm * apart(c);
      const auto push = [&](int branch, double along, double radius, const Vec3& way) {
        Request& request = prepared(all, branch);
        // A vessel does not get out of the way by moving along itself.
        const Vec3 own = tree_.paths[index(branch)].at(along, 1).head<3>().normalized();
        const Vec3 across = way - way.dot(own) * own;
        for_near(branch, along, kMoveWidth * radius, [&](Eigen::Index i, double weight) {
          request.moves.col(i) += weight * across;
          request.weights(i) += weight;
        });
      };
      push(c.first, c.first_along, r1, -r2 / (r1 + r2) * step);
      push(c.second, c.second_along, r2, r1 / (r1 + r2) * step);
    }
    bool any = false;
    for (std::size_t b = 0; b < all.size(); ++b) {
      if (all[b].weights.size() > 0) any = displace(b, all[b]) || any;
    }
    return any;
  }

  bool displace(std::size_t b, const Request& request) {
    Eigen::Matrix4Xd points = tree_.paths[b].control_points();
    double largest = 0;
    for (Eigen::Index i = 0; i < points.cols(); ++i) {
      if (!(request.weights(i) > 0)) continue;
      const Vec3 home = original_[b].control_points().col(i).head<3>();
      const Vec3 before = points.col(i).head<3>();
      const double most = options_.largest_move * original_[b].control_points()(3, i);
      Vec3 away =
          before + held_[b](i) / std::max(1.0, request.weights(i)) * request.moves.col(i) - home;
      if (away.norm() > most) away *= most / away.norm();
      points.col(i).head<3>() = home + away;
      largest = std::max(largest, (home + away - before).norm() / points(3, i));
    }
    tree_.paths[b] = BSplineCurve<4>(tree_.paths[b].knots(), std::move(points));
    return largest > kWorthNaming;
  }

  // Each radius of a pair gives way by the same share.
  bool thin(const std::vector<VesselContact>& contacts) {
    std::vector<Request> all = requests();
    for (const VesselContact& c : contacts) {
      const double r1 = radius_at(c.first, c.first_along);
      const double r2 = radius_at(c.second, c.second_along);
      const double needed = r1 + r2 + options_.clearance * std::min(r1, r2);
      const double share = std::clamp(1 - kOvershoot * c.depth_mm / needed, 0.0, 1.0);
      for (const auto& [branch, along, radius] :
           {std::tuple{c.first, c.first_along, r1}, {c.second, c.second_along, r2}}) {
        Request& request = prepared(all, branch);
        for_near(branch, along, kThinWidth * radius, [&, s = share](Eigen::Index i, double weight) {
          request.shares(i) = std::min(request.shares(i), 1 - weight * (1 - s));
        });
      }
    }
    bool any = false;
    for (std::size_t b = 0; b < all.size(); ++b) {
      if (all[b].weights.size() == 0) continue;
      Eigen::Matrix4Xd points = tree_.paths[b].control_points();
      for (Eigen::Index i = 0; i < points.cols(); ++i) {
        const double least = options_.thinnest * original_[b].control_points()(3, i);
        const double radius = std::max(least, all[b].shares(i) * points(3, i));
        any = any || radius < (1 - kWorthNaming) * points(3, i);
        points(3, i) = std::min(points(3, i), radius);
      }
      tree_.paths[b] = BSplineCurve<4>(tree_.paths[b].knots(), std::move(points));
    }
    return any;
  }

  void name_changes() {
    for (std::size_t b = 0; b < tree_.paths.size(); ++b) {
      double moved = 0, moved_mm = 0, kept = 1;
      const int count = 4 * tree_.paths[b].knots().control_point_count();
      for (int k = 0; k <= count; ++k) {
        const double t = tree_.paths[b].knots().last() * k / count;
        const Vec4 before = original_[b].at(t);
        const Vec4 after = tree_.paths[b].at(t);
        const double way = (after - before).head<3>().norm();
        moved_mm = std::max(moved_mm, way);
        moved = std::max(moved, way / before(3));
        kept = std::min(kept, after(3) / before(3));
      }
      const std::string& name = tree_.tree.branches[b].name;
      if (moved > kWorthNaming) {
        tree_.warnings.push_back(fmt::format(
            "branch {} was moved by up to {:.3g} mm ({:.2g} radii) to keep clear of its "
            "neighbours",
            name, moved_mm, moved));
      }
      if (kept < 1 - kWorthNaming) {
        tree_.warnings.push_back(fmt::format(
            "branch {} was thinned to {:.0f} % to keep clear of its neighbours", name, 100 * kept));
      }
    }
    // Free ends may have moved.
    for (std::size_t b = 0; b < tree_.paths.size(); ++b) {
      CenterlineBranch& branch = tree_.tree.branches[b];
      const double last = tree_.paths[b].knots().last();
      tree_.tree.nodes[index(branch.from)].position_mm = tree_.paths[b].at(0.0).head<3>();
      tree_.tree.nodes[index(branch.to)].position_mm = tree_.paths[b].at(last).head<3>();
      branch.points_mm.col(0) = tree_.paths[b].at(0.0).head<3>();
      branch.points_mm.rightCols(1) = tree_.paths[b].at(last).head<3>();
    }
  }

  SmoothedTree& tree_;
  const KeepApartOptions& options_;
  std::vector<BSplineCurve<4>> original_;
  std::vector<std::array<bool, 2>> joined_;  // ends of each branch that are at junctions
  std::vector<Eigen::VectorXd> held_;
};

}  // namespace

SmoothedTree keep_apart(SmoothedTree tree, const KeepApartOptions& options) {
  EXPECTS(options.clearance >= 0 && options.largest_move >= 0);
  EXPECTS(options.thinnest > 0 && options.thinnest <= 1);
  Separator(tree, options).run();
  return tree;
}

}  // namespace angiospline
