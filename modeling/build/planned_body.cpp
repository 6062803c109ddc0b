#include "modeling/build/planned_body.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "base/index.h"
#include "modeling/body/body.h"
#include "modeling/body/path.h"

namespace angiospline {
namespace {

constexpr double kFarFromCenterline = 0.5;  // radii that are worth a warning
constexpr double kFoldedBody = 0.02;        // Jacobian ratio of a body that counts as folded
constexpr double kStraightened = 6.0;       // radii of body that may be straightened when it folds
constexpr double kShortestPiece = 0.1;      // length of a body that is worth having, in radii

// Where one end of a body lies on its branch and what is beyond it.
struct Stop {
  PathEnd path;
  BodyEnd body;
  BodyLink link;
  double along = 0;  // from the branch's beginning
};

bool close_at_opening(const BodyLink& opening, const BodyLink& rim, PlannedBody& outcome) {
  if (opening.kind != BodyLink::Kind::kOpening) return false;
  outcome.closed.push_back({opening.junction, opening.opening, rim.rim_name, rim.rim_kind});
  return true;
}

Eigen::Matrix4Xd straight(const Stop& start, const Stop& end) {
  Eigen::Matrix4Xd target(4, 2);
  target.col(0) << start.path.point_mm, start.path.radius_mm;
  target.col(1) << end.path.point_mm, end.path.radius_mm;
  return target;
}

// The two ends of a body that folds; a free one is moved into the axis of the opening opposite.
std::pair<Stop, Stop> straightened(Stop start, Stop end) {
  const double length = std::max((end.path.point_mm - start.path.point_mm).norm(),
                                 kShortestPiece * start.path.radius_mm);
  if (end.path.direction.isZero() && !start.path.direction.isZero()) {
    end.path.point_mm = start.path.point_mm + length * start.path.direction;
  } else if (start.path.direction.isZero() && !end.path.direction.isZero()) {
    start.path.point_mm = end.path.point_mm - length * end.path.direction;
  }
  return {start, end};
}

// The branch's samples strictly between the two ends.
Eigen::Matrix4Xd followed(const PlannedBranch& branch, const Stop& start, const Stop& end) {
  const double clear = 0.05 * (start.path.radius_mm + end.path.radius_mm);
  std::vector<Eigen::Index> inside;
  for (Eigen::Index i = 0; i < branch.samples.cols(); ++i) {
    const double along = branch.along_mm[static_cast<std::size_t>(i)];
    if (along > start.along + clear && along < end.along - clear) inside.push_back(i);
  }
  if (branch.straight || inside.size() < 2) return straight(start, end);
  return branch.samples(Eigen::all, inside);
}

double smallest_radius(const BSplineCurve<4>& curve) {
  double least = std::numeric_limits<double>::infinity();
  const int count = 4 * curve.knots().control_point_count();
  for (int i = 0; i <= count; ++i) {
    least = std::min(least, curve.at(static_cast<double>(i) / count)(3));
  }
  return least;
}

// Of the axis from the branch between its stops.
AxisDeparture departure(const PlannedBranch& branch, const Stop& start, const Stop& end,
                        const BodyPiece& piece) {
  if (!piece.path) return {};
  std::vector<Eigen::Index> columns;
  std::vector<double> parameters;
  for (Eigen::Index i = 0; i < branch.samples.cols(); ++i) {
    const double along = branch.along_mm[static_cast<std::size_t>(i)];
    if (along < start.along || along > end.along) continue;
    columns.push_back(i);
    parameters.push_back((along - start.along) / (end.along - start.along));
  }
  return departure_from(*piece.path, branch.samples(Eigen::all, columns), parameters);
}

class BodyBuilder {
 public:
  explicit BodyBuilder(const BodySurroundings& around)
      : tree_(around.tree),
        plan_(around.plan),
        options_(around.options),
        junctions_(around.junctions),
        number_(around.number),
        flow_(around.flow) {}

  PlannedBody build(int b) const { return is_ring(b) ? build_ring(b) : build_body(b); }

 private:
  bool is_ring(int b) const {
    const PlannedBranch& branch = plan_.branches()[index(b)];
    return branch.from == branch.to && plan_.nodes()[index(branch.from)].ends.size() == 2;
  }

  Stop stop_at(int b, bool at_end) const {
    const PlannedBranch& branch = plan_.branches()[index(b)];
    const int n = at_end ? branch.to : branch.from;
    const PlannedNode& node = plan_.nodes()[index(n)];
    Stop stop;
    stop.along = at_end ? branch.length_mm() : 0.0;
    if (!node.is_junction()) {
      const Vec4 tip = branch.at(stop.along);
      stop.path = {tip.head<3>(), tip(3), Vec3::Zero()};
      stop.link.rim_name = rim_name(n, stop.link.rim_kind);
      return stop;
    }
    const auto slot = static_cast<std::size_t>(
        std::find_if(node.ends.begin(), node.ends.end(),
                     [&](const BranchEnd& e) { return e.branch == b && e.at_end == at_end; }) -
        node.ends.begin());
    double distance = node.spec.branches[slot].radius_mm;
    if (number_[index(n)] < 0) {
      if (!node.error) distance = node.wanted_mm[slot];
    } else {
      distance =
          (junctions_[index(number_[index(n)])].openings[slot].center_mm - node.center_mm).norm();
    }
    if (!node.meets_mm.empty()) distance = std::max(distance, node.meets_mm[slot]);
    const double from_node = branch.along_at_distance({b, at_end}, node.center_mm, distance)
                                 .value_or(branch.length_mm());
    stop.along = at_end ? branch.length_mm() - from_node : from_node;
    if (number_[index(n)] < 0) {
      const Vec4 place = branch.at(stop.along);
      stop.path = {place.head<3>(), place(3), Vec3::Zero()};
      stop.link.rim_name =
          fmt::format("cap_{}_{}{}", node.name, branch.name,
                      branch.from == branch.to ? (at_end ? "_end" : "_begin") : "");
      return stop;
    }
    stop.link.kind = BodyLink::Kind::kOpening;
    stop.link.junction = number_[index(n)];
    stop.link.opening = static_cast<int>(slot);
    stop.body = opening_end(junctions_[index(stop.link.junction)], stop.link.opening, !at_end);
    stop.path = {stop.body.center_mm, stop.body.radius_mm, stop.body.tangent};
    return stop;
  }

  std::string rim_name(int n, RimKind& kind) const {
    const PlannedNode& node = plan_.nodes()[index(n)];
    if (flow_[index(n)] == 0) {
      kind = RimKind::kCap;
      return "cap_" + node.name;
    }
    if (node.inlet) {
      kind = RimKind::kInlet;
      return tree_.tree.inlets.size() == 1 ? "inlet" : "inlet_" + node.name;
    }
    kind = RimKind::kOutlet;
    return "outlet_" + node.name;
  }

  PlannedBody build_body(int b) const {
    const PlannedBranch& branch = plan_.branches()[index(b)];
    Stop start = stop_at(b, false);
    Stop end = stop_at(b, true);
    PlannedBody outcome;
    const double radius = (start.path.radius_mm + end.path.radius_mm) / 2;
    const bool capped =
        start.link.kind == BodyLink::Kind::kRim || end.link.kind == BodyLink::Kind::kRim;
    if (capped && end.along - start.along < kShortestPiece * radius) {
      // A free end so near the opening is cut there; of a branch between failed junctions nothing
      // is left.
      if (!close_at_opening(start.link, end.link, outcome) &&
          !close_at_opening(end.link, start.link, outcome)) {
        outcome.failed =
            FailedPart{"wall_" + branch.name, "nothing of it is left beyond its junctions"};
      } else {
        outcome.warnings.push_back(
            {WarningCode::kBranchCutAtJunction,
             fmt::format("branch {} ends at the opening of its junction", branch.name)});
      }
      return outcome;
    }
    if (auto added = extend(b, false, start)) outcome.pieces.push_back(std::move(*added));
    if (auto added = extend(b, true, end)) outcome.pieces.push_back(std::move(*added));
    const Eigen::Matrix4Xd target = followed(branch, start, end);
    BodyPiece piece = sweep(target, start, end);
    for (const PathFreedom freedom : {PathFreedom::kNarrower, PathFreedom::kAnyMove}) {
      if (piece.body.jacobian_ratio >= kFoldedBody) break;
      BodyPiece freer = sweep(target, start, end, freedom);
      if (freer.body.jacobian_ratio > piece.body.jacobian_ratio) piece = std::move(freer);
    }
    if (piece.body.jacobian_ratio < kFoldedBody && !capped) {
      // The ends are too near each other for a tube that bends: they are joined directly.
      Body loft = make_lofted_body(start.body, end.body);
      if (loft.jacobian_ratio > piece.body.jacobian_ratio) piece.body = std::move(loft);
    }
    if (piece.body.jacobian_ratio < kFoldedBody &&
        end.along - start.along < kStraightened * radius) {
      // The path is too crooked for its radius: between its ends it goes the shortest way.
      const auto [from, to] = straightened(start, end);
      BodyPiece direct = sweep(straight(from, to), from, to);
      if (direct.body.jacobian_ratio > piece.body.jacobian_ratio) {
        piece = std::move(direct);
        outcome.warnings.push_back(
            {WarningCode::kBranchStraightened,
             fmt::format("branch {} bends more tightly than its radius allows; it was straightened",
                         branch.name)});
      }
    }
    if (piece.body.jacobian_ratio < kFoldedBody) {
      outcome.folded = true;
      outcome.warnings.push_back({WarningCode::kWallFolds,
                                  fmt::format("the wall of branch {} folds (Jacobian ratio {:.2g})",
                                              branch.name, piece.body.jacobian_ratio)});
    }
    if (const AxisDeparture off = departure(branch, start, end, piece);
        off.radii > kFarFromCenterline) {
      outcome.warnings.push_back(
          {WarningCode::kAxisOffCenterline,
           fmt::format(
               "the axis of branch {} leaves its centerline by up to {:.3g} mm ({:.2g} radii)",
               branch.name, off.mm, off.radii)});
    }
    piece.name = "wall_" + branch.name;
    outcome.pieces.push_back(std::move(piece));
    return outcome;
  }

  // A free end that is to be extended becomes a circle that the body shares with its extension.
  std::optional<BodyPiece> extend(int b, bool at_end, Stop& stop) const {
    if (stop.link.kind != BodyLink::Kind::kRim) return std::nullopt;
    const double diameters =
        stop.link.rim_kind == RimKind::kInlet ? options_.extend_inlets : options_.extend_outlets;
    if (!(diameters > 0)) return std::nullopt;
    const Eigen::Matrix4Xd& samples = plan_.branches()[index(b)].samples;
    const Eigen::Index last = samples.cols() - 1;
    const Vec3 along =
        (at_end ? samples.col(last) - samples.col(last - 1) : samples.col(1) - samples.col(0))
            .head<3>()
            .normalized();
    const double radius = stop.path.radius_mm;
    Stop far = stop;
    far.path.point_mm += (at_end ? 2.0 : -2.0) * diameters * radius * along;
    stop.path.direction = along;
    stop.body = {stop.path.point_mm, along, radius,
                 two_arc_circle(stop.path.point_mm, radius, along, along.unitOrthogonal()), true};
    stop.link = {};
    stop.link.kind = BodyLink::Kind::kCircle;
    stop.link.circle = 2 * static_cast<int>(plan_.branches().size()) + 2 * b + (at_end ? 1 : 0);
    const Stop& from = at_end ? stop : far;
    const Stop& to = at_end ? far : stop;
    BodyPiece piece = sweep(straight(from, to), from, to);
    piece.name = "extension_" + far.link.rim_name;
    return piece;
  }

  BodyPiece sweep(const Eigen::Matrix4Xd& target, const Stop& start, const Stop& end,
                  PathFreedom freedom = PathFreedom::kNearTarget) const {
    const BodyPath path = fit_body_path(target, start.path, end.path, freedom);
    BodyPiece piece;
    piece.path = path.curve;
    piece.start = start.body.tangent.isZero() ? free_end(path.curve, 0.0) : start.body;
    piece.end = end.body.tangent.isZero() ? free_end(path.curve, 1.0) : end.body;
    piece.start_link = start.link;
    piece.end_link = end.link;
    piece.body = make_body(path, piece.start, piece.end, {options_.body_tolerance});
    piece.radius_mm = smallest_radius(path.curve);
    return piece;
  }

  // A closed ring without junctions: two bodies on two circles. The path is fitted over one and a
  // half rounds, so that its closing point is like any other.
  PlannedBody build_ring(int b) const {
    const PlannedBranch& branch = plan_.branches()[index(b)];
    const Eigen::Matrix4Xd& once = branch.samples;
    const double length = branch.length_mm();
    const Eigen::Index n = once.cols();
    std::vector<Eigen::Index> columns;
    for (const int turn : {-1, 0, 1}) {
      for (Eigen::Index i = 0; i + 1 < n; ++i) {
        const double along = branch.along_mm[static_cast<std::size_t>(i)] + turn * length;
        if (along >= -0.25 * length && along <= 1.25 * length) columns.push_back(i);
      }
    }
    const Eigen::Matrix4Xd wrapped = once(Eigen::all, columns);
    const auto tip = [&](const Vec4& p) { return PathEnd{p.head<3>(), p(3), Vec3::Zero()}; };
    const BodyPath whole = fit_body_path(wrapped, tip(wrapped.col(0)), tip(wrapped.rightCols<1>()));
    std::array<PathEnd, 2> ends;
    std::array<BodyEnd, 2> circles;
    for (const int side : {0, 1}) {
      const double t = side == 0 ? 1.0 / 6 : 0.5;
      const Vec4 place = whole.curve.at(t);
      const Vec3 tangent = whole.curve.at(t, 1).head<3>().normalized();
      ends[index(side)] = {place.head<3>(), place(3), tangent};
      circles[index(side)] = {
          place.head<3>(), tangent, place(3),
          two_arc_circle(place.head<3>(), place(3), tangent, tangent.unitOrthogonal()), true};
    }
    PlannedBody outcome;
    for (const int half : {0, 1}) {
      constexpr int kSteps = 200;
      Eigen::Matrix4Xd target(4, kSteps - 1);
      for (int i = 1; i < kSteps; ++i) {
        target.col(i - 1) = whole.curve.at(1.0 / 6 + (half + static_cast<double>(i) / kSteps) / 3);
      }
      Stop start{ends[index(half)], circles[index(half)], {}, 0.0};
      Stop end{ends[index(1 - half)], circles[index(1 - half)], {}, length / 2};
      start.link.kind = end.link.kind = BodyLink::Kind::kCircle;
      start.link.circle = 2 * b + half;
      end.link.circle = 2 * b + 1 - half;
      outcome.pieces.push_back(sweep(target, start, end));
      outcome.pieces.back().name = "wall_" + branch.name;
    }
    return outcome;
  }

  const SmoothedTree& tree_;
  const Plan& plan_;
  const BuildOptions& options_;
  const std::vector<Junction>& junctions_;
  const std::vector<int>& number_;
  const std::vector<char>& flow_;
};

}  // namespace

PlannedBody build_planned_body(const BodySurroundings& around, int b) {
  return BodyBuilder(around).build(b);
}

}  // namespace angiospline
