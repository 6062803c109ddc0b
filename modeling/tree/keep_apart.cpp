#include "modeling/tree/keep_apart.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "base/contract.h"
#include "base/index.h"
#include "kernel/evaluate/closest_point.h"
#include "kernel/refine/refinement.h"
#include "modeling/tree/overlaps.h"
#include "modeling/tree/rules.h"

namespace angiospline {
namespace {

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

// Moves the paths' control points. Each has a way of its own and shares that of the junctions at
// both ends of its branch: so a junction moves as one piece, and what is asked for is spread
// smoothly.
class Separator {
 public:
  Separator(SmoothedTree& tree, const KeepApartOptions& options)
      : tree_(tree), options_(options), original_(tree.paths) {
    at_ = branches_at_nodes(tree.tree);
    nodes_.assign(at_.size(), Vec3::Zero());
    node_limits_mm_.assign(at_.size(), std::numeric_limits<double>::infinity());
    for (std::size_t b = 0; b < tree.paths.size(); ++b) {
      const CenterlineBranch& branch = tree.tree.branches[b];
      const double last = tree.paths[b].knots().last();
      for (const auto& [node, along] : {std::pair{branch.from, 0.0}, {branch.to, last}}) {
        double& limit = node_limits_mm_[index(node)];
        limit = std::min(limit, options.largest_move * tree.paths[b].at(along)(3));
      }
      prepare(b);
    }
  }

  void run() {
    const OverlapOptions asked{options_.clearance};
    refine_paths(find_path_contacts(tree_, asked));

    // Steps aim a little beyond, or they would come ever nearer and never arrive.
    const OverlapOptions aimed{options_.clearance + SeparationRules::kAim};
    const auto is_apart = [&] { return find_path_contacts(tree_, asked).empty(); };
    for (int round = 0; round < SeparationRules::kMoveRounds && !is_apart(); ++round) {
      if (!move(find_path_contacts(tree_, aimed))) break;
    }
    for (int round = 0; round < SeparationRules::kBackRounds && give_back(); ++round) {
    }

    // What the limits of moving left too near is left to the radii.
    for (int round = 0; round < SeparationRules::kThinRounds && !is_apart(); ++round) {
      if (!thin(find_path_contacts(tree_, aimed))) break;
    }
    name_changes();
    take_ends();
    name_left(find_overlaps(tree_, asked));
  }

 private:
  // A straight path may have a handful of control points: bumps need some to every radius.
  void refine_paths(const std::vector<PathContact>& contacts) {
    std::vector<char> touched(tree_.paths.size(), 0);
    for (const PathContact& c : contacts) {
      for (const auto& [branch, along] :
           {std::pair{c.first, c.first_along}, {c.second, c.second_along}}) {
        touched[index(branch)] = 1;
        for (const bool at_end : {false, true}) {
          if (!(hold(branch, at_end, along) > 0)) continue;
          for (const int other : at_[index(node_of(branch, at_end))]) touched[index(other)] = 1;
        }
      }
    }

    // A path that is refined is the same path, but all that is counted by control points starts
    // anew.
    for (std::size_t b = 0; b < touched.size(); ++b) {
      if (touched[b] == 0) continue;
      BSplineCurve<4> path = with_knots_each_radius(tree_.paths[b]);
      if (path.knots() == tree_.paths[b].knots()) continue;
      tree_.paths[b] = std::move(path);
      original_[b] = tree_.paths[b];
      prepare(b);
    }
  }

  int node_of(int branch, bool at_end) const {
    const CenterlineBranch& b = tree_.tree.branches[index(branch)];
    return at_end ? b.to : b.from;
  }

  // How much a place on a branch belongs to the junction at its end: 1 within two radii of it, then
  // less, 0 from four radii on and where the end is free.
  double hold(int branch, bool at_end, double along) const {
    if (at_[index(node_of(branch, at_end))].size() < 2) return 0.0;
    const double last = tree_.paths[index(branch)].knots().last();
    const double width =
        SeparationRules::kHeldRadii * radius_at(branch, std::clamp(along, 0.0, last));
    return bump(std::max(0.0, (at_end ? last - along : along) - width) / width);
  }

  // Where on the path the file's points of branch `b` lie, in their order.
  std::vector<double> places_of(std::size_t b, const BSplineCurve<3>& axis) const {
    const Eigen::Matrix4Xd& given = tree_.given[b];
    std::vector<double> along{0.0};
    for (Eigen::Index i = 1; i < given.cols(); ++i) {
      along.push_back(along.back() + (given.col(i) - given.col(i - 1)).head<3>().norm());
    }

    // Ends belong to ends; between them the nearest place, looked for from the same share of the
    // length, and never before the point that comes before.
    const double last = axis.knots().last();
    std::vector<double> places;
    for (Eigen::Index i = 0; i < given.cols(); ++i) {
      const double start = last * along[index(i)] / along.back();
      double t = closest_point_from(axis, Vec3(given.col(i).head<3>()), std::min(last, start)).t;
      if (i == 0) t = 0;
      if (i + 1 == given.cols()) t = last;
      places.push_back(places.empty() ? t : std::max(places.back(), t));
    }
    return places;
  }

  // From each control point's place on the path back to where the file had it.
  void measure_back(std::size_t b) {
    const BSplineCurve<4>& path = original_[b];
    const BSplineCurve<3> axis(path.knots(), path.control_points().topRows<3>());
    const KnotVector& knots = path.knots();
    back_[b] = Eigen::Matrix3Xd::Zero(3, knots.control_point_count());
    if (b >= tree_.given.size() || tree_.given[b].cols() < 2) return;
    places_[b] = places_of(b, axis);

    // Linear between the file's points, at the control point's Greville parameter.
    const std::vector<double>& places = places_[b];
    const auto back = [&](std::size_t j) -> Vec3 {
      return tree_.given[b].col(static_cast<Eigen::Index>(j)).head<3>() - axis.at(places[j]);
    };
    std::size_t k = 0;
    for (int i = 0; i < knots.control_point_count(); ++i) {
      const double g = knots.greville(i);
      while (k + 2 < places.size() && places[k + 1] < g) ++k;
      const double width = places[k + 1] - places[k];
      const double f = width > 0 ? std::clamp((g - places[k]) / width, 0.0, 1.0) : 0.0;
      back_[b].col(i) = (1 - f) * back(k) + f * back(k + 1);
    }
  }

  // Where one of the file's points is too far away all the same, between control
  // points, part of the way is given back. False if there is none.
  bool give_back() {
    std::vector<char> changed(tree_.paths.size(), 0);
    std::vector<double> of_nodes(nodes_.size(), 1.0);
    for (std::size_t b = 0; b < tree_.paths.size(); ++b) {
      const bool has_moved = tree_.paths[b].control_points().topRows<3>() !=
                             original_[b].control_points().topRows<3>();
      if (!places_[b].empty() && has_moved) give_back_of(b, changed, of_nodes);
    }

    for (std::size_t n = 0; n < nodes_.size(); ++n) nodes_[n] *= of_nodes[n];
    bool any = false;
    for (std::size_t b = 0; b < changed.size(); ++b) {
      if (changed[b] != 0) any = displace(b, {}) || any;
    }
    return any;
  }

  // What branch `b` gives back of its own way near points that are too far off; and of its
  // junctions', where these hold such a point. Marks the branches that change.
  void give_back_of(std::size_t b, std::vector<char>& changed, std::vector<double>& of_nodes) {
    const int branch = static_cast<int>(b);
    const BSplineCurve<4>& path = tree_.paths[b];
    const BSplineCurve<3> axis(path.knots(), path.control_points().topRows<3>());
    for (std::size_t k = 0; k < places_[b].size(); ++k) {
      const Vec4 point = tree_.given[b].col(static_cast<Eigen::Index>(k));
      const double most = SeparationRules::kExactLimit * options_.largest_move * point(3);
      const double at = places_[b][k];
      if (closest_point_from(axis, Vec3(point.head<3>()), at).distance <= most) continue;

      changed[b] = 1;
      for_near(branch, at, SeparationRules::kHeldRadii * point(3),
               [&](Eigen::Index i, double weight) {
                 own_[b].col(i) *= 1 - SeparationRules::kGiveBack * weight;
               });
      for (const bool at_end : {false, true}) {
        if (!(hold(branch, at_end, at) > 0)) continue;
        const int n = node_of(branch, at_end);
        of_nodes[index(n)] = 1 - SeparationRules::kGiveBack;
        for (const int other : at_[index(n)]) changed[index(other)] = 1;
      }
    }
  }

  // Into the ball around where the file had it, which reaches at least to where smoothing has it.
  static void hold_near(Vec3& away, const Vec3& back, double most) {
    const double reach =
        std::max(SeparationRules::kInsideLimit * most, SeparationRules::kGivenBack * back.norm());
    const Vec3 off = away - back;
    if (off.norm() > reach) away = back + reach / off.norm() * off;
  }

  // A junction moves as one piece: so that all that moves with it stays near.
  void hold_node_near(std::size_t n) {
    for (int pass = 0; pass < SeparationRules::kPasses; ++pass) {
      for (const int branch : at_[n]) {
        const auto b = index(branch);
        const bool at_end = tree_.tree.branches[b].to == static_cast<int>(n);
        for (Eigen::Index i = 0; i < held_[b].cols(); ++i) {
          if (held_[b](at_end ? 1 : 0, i) < SeparationRules::kHeldFirmly) continue;
          const double radius = original_[b].control_points()(3, i);
          hold_near(nodes_[n], back_[b].col(i), options_.largest_move * radius);
        }
      }
    }
  }

  // What of each control point belongs to the junctions at both ends, and its own way so far.
  void prepare(std::size_t b) {
    const KnotVector& knots = tree_.paths[b].knots();
    const Eigen::Index count = knots.control_point_count();
    if (b >= held_.size()) {
      held_.resize(b + 1);
      own_.resize(b + 1);
      back_.resize(b + 1);
      places_.resize(b + 1);
    }
    measure_back(b);

    own_[b] = Eigen::Matrix3Xd::Zero(3, count);
    held_[b].resize(2, count);
    for (Eigen::Index i = 0; i < count; ++i) {
      const double at = knots.greville(static_cast<int>(i));
      for (const bool at_end : {false, true}) {
        held_[b](at_end ? 1 : 0, i) = hold(static_cast<int>(b), at_end, at);
      }
    }
  }

  double radius_at(int branch, double along) const {
    return tree_.paths[index(branch)].at(along)(3);
  }

  // The direction in which the second vessel leaves the first; of crossing centerlines, across
  // both.
  Vec3 apart(const PathContact& c) const {
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

  // What a contact asks of one of its two branches: to move by `way`, around the place; and of its
  // junctions, as far as they hold that place.
  void push(int branch, double along, double radius, const Vec3& way, std::vector<Request>& all,
            std::vector<Vec4>& of_nodes) const {
    // A vessel does not get out of the way by moving along itself.
    const Vec3 own = tree_.paths[index(branch)].at(along, 1).head<3>().normalized();
    const Vec3 across = way - way.dot(own) * own;

    Request& request = prepared(all, branch);
    for_near(branch, along, SeparationRules::kMoveWidth * radius,
             [&](Eigen::Index i, double weight) {
               request.moves.col(i) += weight * across;
               request.weights(i) += weight;
             });

    for (const bool at_end : {false, true}) {
      const double weight = hold(branch, at_end, along);
      Vec4& node = of_nodes[index(node_of(branch, at_end))];
      node.head<3>() += weight * across;
      node(3) += weight;
    }
  }

  // False when nothing can move any farther.
  bool move(const std::vector<PathContact>& contacts) {
    // Each vessel of a pair goes by a share that grows with the other's radius: the thinner one
    // gives way.
    std::vector<Request> all(tree_.paths.size());
    std::vector<Vec4> of_nodes(nodes_.size(), Vec4::Zero());  // moves and their weights
    for (const PathContact& c : contacts) {
      const double r1 = radius_at(c.first, c.first_along);
      const double r2 = radius_at(c.second, c.second_along);
      const Vec3 step = SeparationRules::kOvershoot * c.depth_mm * apart(c);
      push(c.first, c.first_along, r1, -r2 / (r1 + r2) * step, all, of_nodes);
      push(c.second, c.second_along, r2, r1 / (r1 + r2) * step, all, of_nodes);
    }

    // Junctions first, since their branches go with them. Of many requests each counts by its
    // weight; of a weak one no more than it asks for.
    bool any = false;
    std::vector<char> follows(tree_.paths.size(), 0);
    for (std::size_t n = 0; n < nodes_.size(); ++n) {
      if (!(of_nodes[n](3) > 0)) continue;
      const Vec3 before = nodes_[n];
      nodes_[n] += of_nodes[n].head<3>() / std::max(1.0, of_nodes[n](3));
      hold_node_near(n);
      for (const int b : at_[n]) follows[index(b)] = 1;
      any = any || (nodes_[n] - before).norm() > SeparationRules::kWorthNaming * node_limits_mm_[n];
    }
    for (std::size_t b = 0; b < all.size(); ++b) {
      if (all[b].weights.size() > 0 || follows[b] != 0) any = displace(b, all[b]) || any;
    }
    return any;
  }

  // A branch's own moves where it is free, and its junctions' where it is not.
  bool displace(std::size_t b, const Request& request) {
    Eigen::Matrix4Xd points = tree_.paths[b].control_points();
    const CenterlineBranch& branch = tree_.tree.branches[b];
    double largest = 0;
    for (Eigen::Index i = 0; i < points.cols(); ++i) {
      const Vec4 home = original_[b].control_points().col(i);
      const double most = options_.largest_move * home(3);
      const double at_first = held_[b](0, i);
      const double at_last = held_[b](1, i);

      // Its own way, the less the more a junction holds it.
      if (request.weights.size() > 0 && request.weights(i) > 0) {
        own_[b].col(i) += (1 - at_first) * (1 - at_last) / std::max(1.0, request.weights(i)) *
                          request.moves.col(i);
        Vec3 own = own_[b].col(i);
        hold_near(own, back_[b].col(i), most);
        own_[b].col(i) = own;
      }

      // And its junctions'; of a loop's one junction only once.
      Vec3 away = own_[b].col(i) + at_first * nodes_[index(branch.from)] +
                  at_last * nodes_[index(branch.to)];
      if (branch.from == branch.to) {
        away = own_[b].col(i) + std::max(at_first, at_last) * nodes_[index(branch.from)];
      }
      // The junction's own place is no branch's to limit.
      if (at_first < 1 && at_last < 1) hold_near(away, back_[b].col(i), most);

      const Vec3 before = points.col(i).head<3>();
      points.col(i).head<3>() = home.head<3>() + away;
      largest = std::max(largest, (points.col(i).head<3>() - before).norm() / points(3, i));
    }
    tree_.paths[b] = BSplineCurve<4>(tree_.paths[b].knots(), std::move(points));
    return largest > SeparationRules::kWorthNaming;
  }

  // Each radius of a pair gives way by the same share.
  bool thin(const std::vector<PathContact>& contacts) {
    std::vector<Request> all(tree_.paths.size());
    for (const PathContact& c : contacts) {
      const double r1 = radius_at(c.first, c.first_along);
      const double r2 = radius_at(c.second, c.second_along);
      const double needed = r1 + r2 + options_.clearance * std::min(r1, r2);
      const double share =
          std::clamp(1 - SeparationRules::kOvershoot * c.depth_mm / needed, 0.0, 1.0);
      for (const auto& [branch, along, radius] :
           {std::tuple{c.first, c.first_along, r1}, {c.second, c.second_along, r2}}) {
        Request& request = prepared(all, branch);
        for_near(branch, along, SeparationRules::kThinWidth * radius,
                 [&, s = share](Eigen::Index i, double weight) {
                   request.shares(i) = std::min(request.shares(i), 1 - weight * (1 - s));
                 });
      }
    }

    // No radius grows, and none falls below its least share.
    bool any = false;
    for (std::size_t b = 0; b < all.size(); ++b) {
      if (all[b].weights.size() == 0) continue;
      Eigen::Matrix4Xd points = tree_.paths[b].control_points();
      for (Eigen::Index i = 0; i < points.cols(); ++i) {
        const double least = options_.thinnest * original_[b].control_points()(3, i);
        const double radius = std::max(least, all[b].shares(i) * points(3, i));
        any = any || radius < (1 - SeparationRules::kWorthNaming) * points(3, i);
        points(3, i) = std::min(points(3, i), radius);
      }
      tree_.paths[b] = BSplineCurve<4>(tree_.paths[b].knots(), std::move(points));
    }
    return any;
  }

  // How far branch `b` was moved, and what is left of its radius, between control points too.
  struct Change {
    double moved_radii = 0.0;
    double moved_mm = 0.0;
    double kept = 1.0;
  };
  Change change_of(std::size_t b) const {
    Change change;
    const int count = 4 * tree_.paths[b].knots().control_point_count();
    for (int k = 0; k <= count; ++k) {
      const double t = tree_.paths[b].knots().last() * k / count;
      const Vec4 before = original_[b].at(t);
      const Vec4 after = tree_.paths[b].at(t);
      const double way = (after - before).head<3>().norm();
      change.moved_mm = std::max(change.moved_mm, way);
      change.moved_radii = std::max(change.moved_radii, way / before(3));
      change.kept = std::min(change.kept, after(3) / before(3));
    }
    return change;
  }

  void name_changes() {
    for (std::size_t b = 0; b < tree_.paths.size(); ++b) {
      const Change change = change_of(b);
      const std::string& name = tree_.tree.branches[b].name;
      if (change.moved_radii > SeparationRules::kWorthNaming) {
        tree_.warnings.push_back(
            {WarningCode::kMovedForClearance,
             fmt::format(
                 "branch {} was moved by up to {:.3g} mm ({:.2g} radii) to keep clear of its "
                 "neighbours",
                 name, change.moved_mm, change.moved_radii)});
      }

      if (change.kept < 1 - SeparationRules::kWorthNaming) {
        tree_.warnings.push_back(
            {WarningCode::kThinnedForClearance,
             fmt::format("branch {} was thinned to {:.0f} % to keep clear of its neighbours", name,
                         100 * change.kept)});
      }
    }
  }

  // Nodes and the branches' first and last points go where the paths now end.
  void take_ends() {
    for (std::size_t b = 0; b < tree_.paths.size(); ++b) {
      CenterlineBranch& branch = tree_.tree.branches[b];
      const double last = tree_.paths[b].knots().last();
      tree_.tree.nodes[index(branch.from)].position_mm = tree_.paths[b].at(0.0).head<3>();
      tree_.tree.nodes[index(branch.to)].position_mm = tree_.paths[b].at(last).head<3>();
      branch.points_mm.col(0) = tree_.paths[b].at(0.0).head<3>();
      branch.points_mm.rightCols(1) = tree_.paths[b].at(last).head<3>();
    }
  }

  void name_left(const std::vector<Overlap>& overlaps) {
    for (const Overlap& left : overlaps) {
      const double radius = tree_.tree.branches[index(left.first)].radii_mm.mean();
      if (left.depth_mm <= SeparationRules::kWorthNaming * radius) continue;
      tree_.warnings.push_back(
          {WarningCode::kClearanceMissing,
           fmt::format(
               "{} and {} stay too near each other: {:.3g} mm are missing to a clearance of "
               "{:.3g} radii near ({:.4g}, {:.4g}, {:.4g})",
               tree_.tree.branches[index(left.first)].name,
               tree_.tree.branches[index(left.second)].name, left.depth_mm, options_.clearance,
               left.at_mm.x(), left.at_mm.y(), left.at_mm.z())});
    }
  }

  SmoothedTree& tree_;
  const KeepApartOptions& options_;
  std::vector<BSplineCurve<4>> original_;
  std::vector<std::vector<int>> at_;  // branches at each node
  std::vector<Vec3> nodes_;           // how far each node has moved
  std::vector<double> node_limits_mm_;
  std::vector<Eigen::Matrix2Xd> held_;       // of each control point, by the junctions at both ends
  std::vector<std::vector<double>> places_;  // along the path, of the file's points
  std::vector<Eigen::Matrix3Xd> back_;       // from each to where the file had it
  std::vector<Eigen::Matrix3Xd> own_;        // how far each has moved by itself
};

}  // namespace

SmoothedTree keep_apart(SmoothedTree tree, const KeepApartOptions& options) {
  EXPECTS(options.clearance >= 0 && options.largest_move >= 0);
  EXPECTS(options.thinnest > 0 && options.thinnest <= 1);
  tree.before_clearance = tree.paths;
  Separator(tree, options).run();
  return tree;
}

BSplineCurve<4> with_knots_each_radius(const BSplineCurve<4>& path) {
  const double step = path.control_points().row(3).mean();
  std::vector<double> added;
  const std::vector<double> breaks = path.knots().breakpoints();
  for (std::size_t k = 0; k + 1 < breaks.size(); ++k) {
    const int pieces = static_cast<int>(std::ceil((breaks[k + 1] - breaks[k]) / step));
    for (int i = 1; i < pieces; ++i) {
      added.push_back(breaks[k] + (breaks[k + 1] - breaks[k]) * i / pieces);
    }
  }
  return added.empty() ? path : insert_knots(path, added).value();
}

}  // namespace angiospline
