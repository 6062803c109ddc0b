#include "modeling/build/planned_body.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "base/index.h"
#include "modeling/body/body.h"
#include "modeling/body/path.h"
#include "modeling/build/rules.h"

namespace angiospline {
namespace {

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
                                 PlannedBodyRules::kShortestPiece * start.path.radius_mm);
  if (end.path.direction.isZero() && !start.path.direction.isZero()) {
    end.path.point_mm = start.path.point_mm + length * start.path.direction;
  } else if (start.path.direction.isZero() && !end.path.direction.isZero()) {
    start.path.point_mm = end.path.point_mm - length * end.path.direction;
  }
  return {start, end};
}

// The branch's samples strictly between the two ends.
Eigen::Matrix4Xd followed(const PlannedBranch& branch, const Stop& start, const Stop& end) {
  const double clear = PlannedBodyRules::kClearOfEnds * (start.path.radius_mm + end.path.radius_mm);
  std::vector<Eigen::Index> inside;
  for (Eigen::Index i = 0; i < branch.samples.cols(); ++i) {
    const double along = branch.along_mm[index(i)];
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
    const double along = branch.along_mm[index(i)];
    if (along < start.along || along > end.along) continue;
    columns.push_back(i);
    parameters.push_back((along - start.along) / (end.along - start.along));
  }
  return departure_from(*piece.path, branch.samples(Eigen::all, columns), parameters);
}

// ---------------------------------------------------------------- where a body ends

// The name of what a free end at node `n` becomes: an inlet or outlet where the direction of flow
// is known, otherwise a cap.
std::string rim_name(const BodySurroundings& around, int n, RimKind& kind) {
  const PlannedNode& node = around.plan.nodes[index(n)];
  if (around.flow[index(n)] == 0) {
    kind = RimKind::kCap;
    return "cap_" + node.name;
  }
  if (node.inlet) {
    kind = RimKind::kInlet;
    return around.tree.tree.inlets.size() == 1 ? "inlet" : "inlet_" + node.name;
  }
  kind = RimKind::kOutlet;
  return "outlet_" + node.name;
}

// A free end: the body goes on to the tip of the path.
Stop stop_at_tip(const BodySurroundings& around, BranchEnd end, int n) {
  const PlannedBranch& branch = around.plan.branch(end);
  Stop stop;
  stop.along = end.at_end ? branch.length_mm() : 0.0;
  const Vec4 tip = branch.at(stop.along);
  stop.path = {tip.head<3>(), tip(3), Vec3::Zero()};
  stop.link.rim_name = rim_name(around, n, stop.link.rim_kind);
  return stop;
}

// How far from its centre a junction, built or not, leaves the branch of this slot to its body.
double opening_distance(const BodySurroundings& around, int n, std::size_t slot) {
  const PlannedNode& node = around.plan.nodes[index(n)];
  const int junction = around.number[index(n)];
  double distance = node.spec.branches[slot].radius_mm;
  if (junction >= 0) {
    distance = (around.junctions[index(junction)].openings[slot].center_mm - node.center_mm).norm();
  } else if (!node.error) {
    distance = node.wanted_mm[slot];
  }
  return node.meets_mm.empty() ? distance : std::max(distance, node.meets_mm[slot]);
}

Stop stop_at(const BodySurroundings& around, BranchEnd end) {
  const PlannedBranch& branch = around.plan.branch(end);
  const int n = end.at_end ? branch.to : branch.from;
  const PlannedNode& node = around.plan.nodes[index(n)];
  if (!node.is_junction()) return stop_at_tip(around, end, n);

  Stop stop;
  const std::size_t slot = around.plan.slot(end);
  const double from_node =
      branch.along_at_distance(end, node.center_mm, opening_distance(around, n, slot))
          .value_or(branch.length_mm());
  stop.along = end.at_end ? branch.length_mm() - from_node : from_node;

  // Where the junction could not be built the body ends in a cap of its own.
  if (around.number[index(n)] < 0) {
    const Vec4 place = branch.at(stop.along);
    stop.path = {place.head<3>(), place(3), Vec3::Zero()};
    stop.link.rim_name =
        fmt::format("cap_{}_{}{}", node.name, branch.name,
                    branch.from == branch.to ? (end.at_end ? "_end" : "_begin") : "");
    return stop;
  }

  stop.link.kind = BodyLink::Kind::kOpening;
  stop.link.junction = around.number[index(n)];
  stop.link.opening = static_cast<int>(slot);
  stop.body =
      opening_end(around.junctions[index(stop.link.junction)], stop.link.opening, !end.at_end);
  stop.path = {stop.body.center_mm, stop.body.radius_mm, stop.body.tangent};
  return stop;
}

// ---------------------------------------------------------------- bodies

BodyPiece sweep(const BuildOptions& options, const Eigen::Matrix4Xd& target, const Stop& start,
                const Stop& end, PathFreedom freedom = PathFreedom::kNearTarget) {
  const BodyPath path = fit_body_path(target, start.path, end.path, freedom);
  BodyPiece piece;
  piece.path = path.curve;
  piece.start = start.body.tangent.isZero() ? free_end(path.curve, 0.0) : start.body;
  piece.end = end.body.tangent.isZero() ? free_end(path.curve, 1.0) : end.body;
  piece.start_link = start.link;
  piece.end_link = end.link;
  piece.body = make_body(path, piece.start, piece.end, {options.body_tolerance});
  piece.radius_mm = smallest_radius(path.curve);
  return piece;
}

// A free end that is to be extended becomes a circle that the body shares with its extension.
std::optional<BodyPiece> extension(const BodySurroundings& around, BranchEnd branch_end,
                                   Stop& stop) {
  if (stop.link.kind != BodyLink::Kind::kRim) return std::nullopt;
  const double diameters = stop.link.rim_kind == RimKind::kInlet ? around.options.extend_inlets
                                                                 : around.options.extend_outlets;
  if (!(diameters > 0)) return std::nullopt;
  const bool at_end = branch_end.at_end;
  const Eigen::Matrix4Xd& samples = around.plan.branch(branch_end).samples;
  const Eigen::Index last = samples.cols() - 1;
  const Vec3 along =
      (at_end ? samples.col(last) - samples.col(last - 1) : samples.col(1) - samples.col(0))
          .head<3>()
          .normalized();
  const double radius = stop.path.radius_mm;
  Stop far = stop;
  far.path.point_mm += (at_end ? 2.0 : -2.0) * diameters * radius * along;

  // Numbers of circles: rings of the plan have the first two to each branch, extensions the next.
  stop.path.direction = along;
  stop.body = {stop.path.point_mm, along, radius,
               two_arc_circle(stop.path.point_mm, radius, along, along.unitOrthogonal()), true};
  stop.link = {};
  stop.link.kind = BodyLink::Kind::kCircle;
  stop.link.circle =
      2 * static_cast<int>(around.plan.branches.size()) + 2 * branch_end.branch + (at_end ? 1 : 0);

  const Stop& from = at_end ? stop : far;
  const Stop& to = at_end ? far : stop;
  BodyPiece piece = sweep(around.options, straight(from, to), from, to);
  piece.name = "extension_" + far.link.rim_name;
  return piece;
}

// A branch of which next to nothing lies between a cap and what is opposite: a free end so near an
// opening is cut there; of a branch between failed junctions nothing is left.
PlannedBody cut_at_cap(const PlannedBranch& branch, const Stop& start, const Stop& end) {
  PlannedBody outcome;
  if (close_at_opening(start.link, end.link, outcome) ||
      close_at_opening(end.link, start.link, outcome)) {
    outcome.warnings.push_back(
        {WarningCode::kBranchCutAtJunction,
         fmt::format("branch {} ends at the opening of its junction", branch.name)});
  } else {
    outcome.failed =
        FailedPart{"wall_" + branch.name, "nothing of it is left beyond its junctions"};
  }
  return outcome;
}

// What a body is built between.
struct Course {
  Stop start;
  Stop end;
  Eigen::Matrix4Xd target;  // the branch's samples between them

  double length() const { return end.along - start.along; }
  double radius() const { return (start.path.radius_mm + end.path.radius_mm) / 2; }
  bool capped() const {
    return start.link.kind == BodyLink::Kind::kRim || end.link.kind == BodyLink::Kind::kRim;
  }
};

// The ways in which a body that folds is tried, in this order, each giving up more than the one
// before: more of the radius in tight bends; any move of the axis; a loft where the ends are too
// near each other for a tube that bends; the shortest way where the path is too crooked for its
// radius.
enum class Rung { kNarrower, kAnyMove, kLoft, kStraight };
constexpr std::array<Rung, 4> kLadder{Rung::kNarrower, Rung::kAnyMove, Rung::kLoft,
                                      Rung::kStraight};

// The body by this way; nothing where it does not apply. `best`: the one so far.
std::optional<BodyPiece> piece_by(Rung rung, const BuildOptions& options, const Course& course,
                                  bool capped, const BodyPiece& best) {
  switch (rung) {
    case Rung::kNarrower:
      return sweep(options, course.target, course.start, course.end, PathFreedom::kNarrower);
    case Rung::kAnyMove:
      return sweep(options, course.target, course.start, course.end, PathFreedom::kAnyMove);
    case Rung::kLoft: {
      if (capped) return std::nullopt;
      BodyPiece lofted = best;
      lofted.body = make_lofted_body(course.start.body, course.end.body);
      return lofted;
    }
    case Rung::kStraight: {
      if (!(course.length() < PlannedBodyRules::kStraightened * course.radius())) {
        return std::nullopt;
      }
      const auto [from, to] = straightened(course.start, course.end);
      return sweep(options, straight(from, to), from, to);
    }
  }
  return std::nullopt;
}

PlannedBody build_body(const BodySurroundings& around, int b) {
  const PlannedBranch& branch = around.plan.branches[index(b)];
  Course course{stop_at(around, {b, false}), stop_at(around, {b, true}), {}};
  const bool capped = course.capped();
  if (capped && course.length() < PlannedBodyRules::kShortestPiece * course.radius()) {
    return cut_at_cap(branch, course.start, course.end);
  }

  // Extensions first: they turn free ends into circles, which the body then meets.
  PlannedBody outcome;
  for (const bool at_end : {false, true}) {
    auto added = extension(around, {b, at_end}, at_end ? course.end : course.start);
    if (added) outcome.pieces.push_back(std::move(*added));
  }
  course.target = followed(branch, course.start, course.end);

  BodyPiece piece = sweep(around.options, course.target, course.start, course.end);
  for (const Rung rung : kLadder) {
    if (piece.body.jacobian_ratio >= PlannedBodyRules::kFolded) break;
    auto tried = piece_by(rung, around.options, course, capped, piece);
    if (!tried || !(tried->body.jacobian_ratio > piece.body.jacobian_ratio)) continue;
    piece = std::move(*tried);
    if (rung == Rung::kStraight) {
      outcome.warnings.push_back(
          {WarningCode::kBranchStraightened,
           fmt::format("branch {} bends more tightly than its radius allows; it was straightened",
                       branch.name)});
    }
  }

  // What is not as it should be is said.
  if (piece.body.jacobian_ratio < PlannedBodyRules::kFolded) {
    outcome.folded = true;
    outcome.warnings.push_back(
        {WarningCode::kWallFolds, fmt::format("the wall of branch {} folds (Jacobian ratio {:.2g})",
                                              branch.name, piece.body.jacobian_ratio)});
  }
  const AxisDeparture off = departure(branch, course.start, course.end, piece);
  if (off.radii > PlannedBodyRules::kFarFromCenterline) {
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

// ---------------------------------------------------------------- rings

// The samples of a ring over one and a half rounds, so that its closing point is like any other.
Eigen::Matrix4Xd wrapped_samples(const PlannedBranch& branch) {
  const double length = branch.length_mm();
  const double beyond = PlannedBodyRules::kRingOverlap;
  std::vector<Eigen::Index> columns;
  for (const int turn : {-1, 0, 1}) {
    for (Eigen::Index i = 0; i + 1 < branch.samples.cols(); ++i) {
      const double along = branch.along_mm[index(i)] + turn * length;
      if (along >= -beyond * length && along <= (1 + beyond) * length) columns.push_back(i);
    }
  }
  return branch.samples(Eigen::all, columns);
}

// The place of a path as the end of half a ring: a circle that both halves share.
Stop circle_stop(const BSplineCurve<4>& path, double t, int circle, double along) {
  const Vec4 place = path.at(t);
  const Vec3 tangent = path.at(t, 1).head<3>().normalized();
  Stop stop;
  stop.path = {place.head<3>(), place(3), tangent};
  stop.body = {place.head<3>(), tangent, place(3),
               two_arc_circle(place.head<3>(), place(3), tangent, tangent.unitOrthogonal()), true};
  stop.link.kind = BodyLink::Kind::kCircle;
  stop.link.circle = circle;
  stop.along = along;
  return stop;
}

// A closed ring without junctions: two bodies on two circles, each a third of the wrapped path.
PlannedBody build_ring(const BodySurroundings& around, int b) {
  const PlannedBranch& branch = around.plan.branches[index(b)];
  const Eigen::Matrix4Xd wrapped = wrapped_samples(branch);
  const auto tip = [](const Vec4& p) { return PathEnd{p.head<3>(), p(3), Vec3::Zero()}; };
  const BodyPath whole = fit_body_path(wrapped, tip(wrapped.col(0)), tip(wrapped.rightCols<1>()));

  PlannedBody outcome;
  constexpr std::array<double, 2> kCircleAt{1.0 / 6, 0.5};
  constexpr int kSteps = PlannedBodyRules::kRingSamples;
  for (const int half : {0, 1}) {
    Eigen::Matrix4Xd target(4, kSteps - 1);
    for (int i = 1; i < kSteps; ++i) {
      target.col(i - 1) = whole.curve.at(1.0 / 6 + (half + static_cast<double>(i) / kSteps) / 3);
    }
    const Stop start = circle_stop(whole.curve, kCircleAt[index(half)], 2 * b + half, 0.0);
    const Stop end = circle_stop(whole.curve, kCircleAt[index(1 - half)], 2 * b + 1 - half,
                                 branch.length_mm() / 2);
    outcome.pieces.push_back(sweep(around.options, target, start, end));
    outcome.pieces.back().name = "wall_" + branch.name;
  }
  return outcome;
}

bool is_ring(const Plan& plan, const PlannedBranch& branch) {
  return branch.from == branch.to && plan.nodes[index(branch.from)].ends.size() == 2;
}

}  // namespace

PlannedBody build_planned_body(const BodySurroundings& around, int b) {
  const bool ring = is_ring(around.plan, around.plan.branches[index(b)]);
  return ring ? build_ring(around, b) : build_body(around, b);
}

}  // namespace angiospline
