#include "modeling/seed_model.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <map>
#include <optional>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "base/contract.h"
#include "modeling/assembly.h"
#include "modeling/body.h"
#include "modeling/body_path.h"
#include "modeling/keep_apart.h"
#include "modeling/make_room.h"
#include "modeling/round_tree.h"
#include "modeling/seed_plan.h"

namespace angiospline {
namespace {

constexpr int kJunctionRounds = 6;  // of building, changing the plan of what failed, building again
constexpr std::array<double, 3> kForwardRadii{1.0, 2.0, 4.0};  // of the first rounds, each on top
constexpr int kBendRounds = 5;         // of letting branches bend inside their junctions, at most
constexpr int kFewSettings = 3;        // of a junction inside which branches bend
constexpr double kReachFarther = 1.6;  // times the distance at which directions are taken
constexpr double kMergeReach = 6.0;    // radii of branch between junctions that may be merged
constexpr double kFarFromCenterline = 0.5;  // radii that are worth a warning
constexpr std::size_t kCrowded = 6;         // branches beyond which a junction of several is cut
constexpr std::size_t kMayGrow = 5;         // of one that failed and may be merged with another
constexpr int kRoomRounds = 24;             // of cutting junctions and planning again,
constexpr int kRoomBuilds = 5;              // and of building what was planned
constexpr int kMergePasses = 3;             // of merging junctions between which the body folds
constexpr double kFoldedBody = 0.02;        // Jacobian ratio of a body that counts as folded
constexpr double kStraightened = 6.0;       // radii of body that may be straightened when it folds
constexpr double kShortestPiece = 0.1;      // length of a body that is worth having, in radii

std::size_t index(int i) { return static_cast<std::size_t>(i); }

// A junction that was built, for one state of the plan.
struct BuiltJunction {
  JunctionSpec spec;
  std::optional<Junction> junction;
  std::optional<Error> error;
};

using BuiltByName = std::map<std::string, BuiltJunction>;

bool same(const JunctionSpec& a, const JunctionSpec& b) {
  if (a.name != b.name || a.center_mm != b.center_mm || a.branches.size() != b.branches.size()) {
    return false;
  }
  for (std::size_t k = 0; k < a.branches.size(); ++k) {
    const JunctionBranch& x = a.branches[k];
    const JunctionBranch& y = b.branches[k];
    if (x.direction != y.direction || x.radius_mm != y.radius_mm || x.longest_mm != y.longest_mm ||
        x.offset_mm != y.offset_mm) {
      return false;
    }
  }
  return true;
}

// The same with all branches taken for rays from the centre to where they are wanted.
JunctionSpec centered(const PlannedNode& node) {
  JunctionSpec spec = node.spec;
  for (std::size_t k = 0; k < spec.branches.size(); ++k) {
    JunctionBranch& branch = spec.branches[k];
    branch.direction = place_on_branch_mm(branch, node.wanted_mm[k]).normalized();
    branch.offset_mm.setZero();
  }
  return spec;
}

// A junction inside which branches bend: a few settings say whether it can be had.
BuiltJunction build_bent_junction(const PlannedNode& node, JunctionOptions options,
                                  const Progress& progress) {
  BuiltJunction built{node.spec, {}, node.error};
  if (node.error) return built;
  options.settings = std::min(options.settings, kFewSettings);
  Result<Junction> junction = make_junction(node.spec, options, progress);
  if (!junction) {
    built.error = junction.error();
  } else if (junction->fair) {
    built.junction = std::move(*junction);
  }
  return built;
}

// The junction with the options asked for; if that fails, with openings farther out. Branches that
// do not meet in a point are first taken as if they did, with the openings where they are planned:
// that is built sooner, and more often.
BuiltJunction build_junction(const PlannedNode& node, const JunctionOptions& options,
                             const Progress& progress) {
  BuiltJunction built{node.spec, {}, node.error};
  if (node.error) return built;
  const bool is_centered =
      std::all_of(node.spec.branches.begin(), node.spec.branches.end(),
                  [](const JunctionBranch& b) { return b.offset_mm.isZero(0); });
  struct Try {
    bool as_planned;
    double margin;
  };
  for (const Try& next : {Try{is_centered, 1.0}, Try{true, is_centered ? 1.6 : 1.0}}) {
    JunctionOptions tried = options;
    tried.margin *= next.margin;
    Result<Junction> junction =
        make_junction(next.as_planned ? node.spec : centered(node), tried, progress);
    if (junction) {
      built.junction = std::move(*junction);
      built.error.reset();
      return built;
    }
    if (progress.should_stop()) return built;
    if (!built.error) built.error = junction.error();
  }
  return built;
}

class Seeder {
 public:
  Seeder(const SmoothedTree& tree, const SeedOptions& options, const Progress& progress)
      : tree_(tree), options_(options), progress_(progress), plan_(tree, options.junction) {
    find_flow();
    built_.resize(plan_.nodes().size());
    built_before_.resize(built_.size());
  }

  // Junctions of a former plan: those that are planned again as they were are not built again.
  void reuse(BuiltByName known) {
    for (std::size_t n = 0; n < built_.size(); ++n) {
      const auto found = known.find(plan_.nodes()[n].spec.name);
      if (found != known.end()) built_[n] = std::move(found->second);
    }
  }
  BuiltByName built() {
    BuiltByName all;
    for (BuiltJunction& junction : built_) {
      if (!junction.junction) continue;
      const std::string name = junction.spec.name;
      all.emplace(name, std::move(junction));
    }
    return all;
  }

  // Junctions that became one of too many branches, and those of several that could not be
  // built, or of many only as no fair surface.
  std::vector<PlannedNode> crowded() const {
    return merged_nodes([&](std::size_t n) { return plan_.nodes()[n].ends.size() > kCrowded; });
  }
  std::vector<PlannedNode> failed() const {
    return merged_nodes([&](std::size_t n) {
      const bool many = plan_.nodes()[n].ends.size() > kMayGrow;
      return !built_[n].junction || (many && !built_[n].junction->fair);
    });
  }

  Result<Model> run() {
    plan_.find_bends();
    const SeedPlan unbent = plan_;
    refused_.assign(plan_.nodes().size(), 0);
    for (int round = 0; round < kBendRounds; ++round) {
      bent_ = plan_.bend(refused_);
      if (bent_.empty() || build_bent()) break;
      if (progress_.should_stop()) return fail(cancelled("junctions"));
      plan_ = unbent;
      bent_.clear();
    }
    for (int merges = 0;;) {
      if (!build_junctions()) return fail(cancelled("junctions"));
      number_junctions();
      if (!build_bodies()) return fail(cancelled("bodies"));
      if (unbend_folded()) {
        plan_ = unbent;
        bent_ = plan_.bend(refused_);
        continue;
      }
      if (merges++ == kMergePasses || !merge_folded()) break;
    }
    progress_.at("assemble", 0.0);
    if (pieces_.empty() && junctions_.empty()) {
      return fail({ErrorKind::kFailed,
                   "nothing could be built",
                   tree_.tree.source,
                   failed_.empty() ? std::string() : failed_.front().why,
                   {}});
    }
    Model model;
    model.network = assemble(junctions_, pieces_, closed_);
    model.tree = tree_.tree;
    model.assumptions = tree_.tree.assumptions;
    model.warnings = tree_.warnings;
    model.warnings.insert(model.warnings.end(), plan_.warnings().begin(), plan_.warnings().end());
    model.warnings.insert(model.warnings.end(), warnings_.begin(), warnings_.end());
    warn_of_unfair_junctions(model);
    model.failed = std::move(failed_);
    progress_.at("assemble", 1.0);
    return model;
  }

 private:
  template <typename Predicate>
  std::vector<PlannedNode> merged_nodes(const Predicate& is_wanted) const {
    std::vector<PlannedNode> nodes;
    for (std::size_t n = 0; n < built_.size(); ++n) {
      const PlannedNode& node = plan_.nodes()[n];
      if (node.is_junction() && !node.absorbed.empty() && is_wanted(n)) nodes.push_back(node);
    }
    return nodes;
  }

  // ---- junctions

  // Whether this node's junction, as it is planned now, has been built before; then it is there.
  bool is_built(int n) {
    const JunctionSpec& wanted = plan_.nodes()[index(n)].spec;
    BuiltJunction& now = built_[index(n)];
    if (same(now.spec, wanted)) return true;
    std::vector<BuiltJunction>& before = built_before_[index(n)];
    const auto found = std::find_if(before.begin(), before.end(), [&](const BuiltJunction& built) {
      return same(built.spec, wanted);
    });
    if (found != before.end()) {
      std::swap(now, *found);
      return true;
    }
    if (now.junction) before.push_back(std::move(now));
    now = {};
    return false;
  }

  // Where branches bend inside their junctions these are built; what fails is refused. Whether
  // nothing did.
  bool build_bent() {
    std::vector<int> work;
    for (const int n : bent_) {
      if (!is_built(n)) work.push_back(n);
    }
    tbb::parallel_for(std::size_t{0}, work.size(), [&](std::size_t k) {
      built_[index(work[k])] =
          build_bent_junction(plan_.nodes()[index(work[k])], options_.junction, progress_);
    });
    bool all = true;
    for (const int n : bent_) {
      if (built_[index(n)].junction) continue;
      ++refused_[index(n)];
      all = false;
    }
    return all;
  }

  // Bodies that fold beside such a junction have lost their room to it.
  bool unbend_folded() {
    bool any = false;
    for (const int b : folded_) {
      const PlannedBranch& branch = plan_.branches()[index(b)];
      for (const int n : {branch.from, branch.to}) {
        if (std::find(bent_.begin(), bent_.end(), n) == bent_.end()) continue;
        ++refused_[index(n)];
        any = true;
      }
    }
    return any;
  }

  bool build_junctions() {
    for (int round = 0; round < kJunctionRounds; ++round) {
      std::vector<int> work;
      for (int n = 0; n < static_cast<int>(plan_.nodes().size()); ++n) {
        const PlannedNode& node = plan_.nodes()[index(n)];
        if (node.is_junction() && !is_built(n)) work.push_back(n);
      }
      std::atomic<std::size_t> done{0};
      tbb::parallel_for(std::size_t{0}, work.size(), [&](std::size_t k) {
        if (progress_.should_stop()) return;
        built_[index(work[k])] =
            build_junction(plan_.nodes()[index(work[k])], options_.junction, progress_);
        progress_.at("junctions", static_cast<double>(++done) / static_cast<double>(work.size()));
      });
      if (progress_.should_stop()) return false;
      if (round + 1 == kJunctionRounds || !change_failed(round)) break;
    }
    return true;
  }

  // What fails mostly has all its branches on one side, where they part only slowly: its centre is
  // moved forward to where they do; then it is merged with its nearest neighbour; then directions
  // are taken farther out.
  bool change_failed(int round) {
    bool changed = false;
    for (int n = 0; n < static_cast<int>(built_.size()); ++n) {
      const PlannedNode& node = plan_.nodes()[index(n)];
      if (!node.is_junction() || built_[index(n)].junction) continue;
      if (!node.absorbed.empty() && node.ends.size() > kMayGrow) continue;  // it is to be cut
      if (index(round) < kForwardRadii.size()) {
        plan_.move_forward(n, kForwardRadii[index(round)]);
        changed = true;
      } else if (plan_.merge_with_nearest(n, kMergeReach)) {
        changed = true;
      } else {
        plan_.reach_farther(n, kReachFarther);
        changed = true;
      }
    }
    if (changed) plan_.settle();
    return changed;
  }

  void number_junctions() {
    number_.assign(built_.size(), -1);
    junctions_.clear();
    failed_.clear();
    for (std::size_t n = 0; n < built_.size(); ++n) {
      const PlannedNode& node = plan_.nodes()[n];
      if (!node.is_junction()) continue;
      if (built_[n].junction) {
        number_[n] = static_cast<int>(junctions_.size());
        junctions_.push_back(*built_[n].junction);
      } else {
        failed_.push_back(
            {"junction_" + node.name, built_[n].error ? built_[n].error->message() : "not built"});
      }
    }
  }

  void warn_of_unfair_junctions(Model& model) const {
    for (const Junction& junction : junctions_) {
      if (junction.fair) continue;
      model.warnings.push_back(fmt::format(
          "{} is smooth but not fair: its curvature times the smallest radius is {:.3g}, and it "
          "departs from its branches by {:.2g} of that radius (below 20 and 0.5 are fair)",
          junction.network.regions.front().name, junction.curvature_times_radius,
          junction.distance_over_radius));
    }
  }

  // ---- bodies

  struct Outcome {
    std::vector<BodyPiece> pieces;
    std::vector<ClosedOpening> closed;
    std::vector<std::string> warnings;
    std::optional<FailedPart> failed;
    bool folded = false;
  };

  bool build_bodies() {
    const std::vector<PlannedBranch>& branches = plan_.branches();
    std::vector<Outcome> outcomes(branches.size());
    std::atomic<std::size_t> done{0};
    tbb::parallel_for(std::size_t{0}, branches.size(), [&](std::size_t b) {
      if (!branches[b].alive || progress_.should_stop()) return;
      outcomes[b] = is_ring(static_cast<int>(b)) ? build_ring(static_cast<int>(b))
                                                 : build_body(static_cast<int>(b));
      progress_.at("bodies", static_cast<double>(++done) / static_cast<double>(branches.size()));
    });
    if (progress_.should_stop()) return false;
    pieces_.clear();
    closed_.clear();
    warnings_.clear();
    folded_.clear();
    for (std::size_t b = 0; b < outcomes.size(); ++b) {
      Outcome& outcome = outcomes[b];
      if (outcome.folded) folded_.push_back(static_cast<int>(b));
      for (BodyPiece& piece : outcome.pieces) pieces_.push_back(std::move(piece));
      for (ClosedOpening& closed : outcome.closed) closed_.push_back(std::move(closed));
      for (std::string& text : outcome.warnings) warnings_.push_back(std::move(text));
      if (outcome.failed) failed_.push_back(std::move(*outcome.failed));
    }
    return true;
  }

  // Junctions between which no body fits become one.
  bool merge_folded() {
    bool merged = false;
    for (const int b : folded_) merged = plan_.merge_along(b) || merged;
    if (merged) plan_.settle();
    return merged;
  }

  bool is_ring(int b) const {
    const PlannedBranch& branch = plan_.branches()[index(b)];
    return branch.from == branch.to && plan_.nodes()[index(branch.from)].ends.size() == 2;
  }

  // Where one end of a body lies on its branch and what is beyond it.
  struct Stop {
    PathEnd path;
    BodyEnd body;
    BodyLink link;
    double along = 0;  // from the branch's beginning
  };

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

  Outcome build_body(int b) const {
    const PlannedBranch& branch = plan_.branches()[index(b)];
    Stop start = stop_at(b, false);
    Stop end = stop_at(b, true);
    Outcome outcome;
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
            fmt::format("branch {} ends at the opening of its junction", branch.name));
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
            fmt::format("branch {} bends more tightly than its radius allows; it was straightened",
                        branch.name));
      }
    }
    if (piece.body.jacobian_ratio < kFoldedBody) {
      outcome.folded = true;
      outcome.warnings.push_back(fmt::format("the wall of branch {} folds (Jacobian ratio {:.2g})",
                                             branch.name, piece.body.jacobian_ratio));
    }
    if (const AxisDeparture off = departure(branch, start, end, piece);
        off.radii > kFarFromCenterline) {
      outcome.warnings.push_back(fmt::format(
          "the axis of branch {} leaves its centerline by up to {:.3g} mm ({:.2g} radii)",
          branch.name, off.mm, off.radii));
    }
    piece.name = "wall_" + branch.name;
    outcome.pieces.push_back(std::move(piece));
    return outcome;
  }

  // Of the axis from the branch between its stops.
  static AxisDeparture departure(const PlannedBranch& branch, const Stop& start, const Stop& end,
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

  static bool close_at_opening(const BodyLink& opening, const BodyLink& rim, Outcome& outcome) {
    if (opening.kind != BodyLink::Kind::kOpening) return false;
    outcome.closed.push_back({opening.junction, opening.opening, rim.rim_name, rim.rim_kind});
    return true;
  }

  // The two ends of a body that folds; a free one is moved into the axis of the opening opposite.
  static std::pair<Stop, Stop> straightened(Stop start, Stop end) {
    const double length = std::max((end.path.point_mm - start.path.point_mm).norm(),
                                   kShortestPiece * start.path.radius_mm);
    if (end.path.direction.isZero() && !start.path.direction.isZero()) {
      end.path.point_mm = start.path.point_mm + length * start.path.direction;
    } else if (start.path.direction.isZero() && !end.path.direction.isZero()) {
      start.path.point_mm = end.path.point_mm - length * end.path.direction;
    }
    return {start, end};
  }

  static Eigen::Matrix4Xd straight(const Stop& start, const Stop& end) {
    Eigen::Matrix4Xd target(4, 2);
    target.col(0) << start.path.point_mm, start.path.radius_mm;
    target.col(1) << end.path.point_mm, end.path.radius_mm;
    return target;
  }

  // The branch's samples strictly between the two ends.
  static Eigen::Matrix4Xd followed(const PlannedBranch& branch, const Stop& start,
                                   const Stop& end) {
    const double clear = 0.05 * (start.path.radius_mm + end.path.radius_mm);
    std::vector<Eigen::Index> inside;
    for (Eigen::Index i = 0; i < branch.samples.cols(); ++i) {
      const double along = branch.along_mm[static_cast<std::size_t>(i)];
      if (along > start.along + clear && along < end.along - clear) inside.push_back(i);
    }
    if (branch.straight || inside.size() < 2) return straight(start, end);
    return branch.samples(Eigen::all, inside);
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

  static double smallest_radius(const BSplineCurve<4>& curve) {
    double least = std::numeric_limits<double>::infinity();
    const int count = 4 * curve.knots().control_point_count();
    for (int i = 0; i <= count; ++i) {
      least = std::min(least, curve.at(static_cast<double>(i) / count)(3));
    }
    return least;
  }

  // A closed ring without junctions: two bodies on two circles. The path is fitted over one and a
  // half rounds, so that its closing point is like any other.
  Outcome build_ring(int b) const {
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
    Outcome outcome;
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

  // Which nodes lie in a component with an inlet: only there is the direction of flow known.
  void find_flow() {
    const std::vector<int> component = components_of_nodes(tree_.tree);
    std::vector<char> fed(component.size() + 1, 0);
    for (const int inlet : tree_.tree.inlets) fed[index(component[index(inlet)])] = 1;
    for (const int c : component) flow_.push_back(fed[index(c)]);
  }

  const SmoothedTree& tree_;
  const SeedOptions& options_;
  const Progress& progress_;
  SeedPlan plan_;
  std::vector<int> refused_;          // ways in which branches do not bend, of each node
  std::vector<int> bent_;             // and those inside which they do
  std::vector<BuiltJunction> built_;  // one for each node of the plan
  std::vector<std::vector<BuiltJunction>> built_before_;  // for other plans of it
  std::vector<int> number_;                               // of each node's junction, or -1
  std::vector<char> flow_;
  std::vector<Junction> junctions_;
  std::vector<BodyPiece> pieces_;
  std::vector<ClosedOpening> closed_;
  std::vector<int> folded_;  // branches whose body folds
  std::vector<std::string> warnings_;
  std::vector<FailedPart> failed_;
};

}  // namespace

Result<Model> seed_model(const CenterlineTree& tree, const SeedOptions& options,
                         const Progress& progress) {
  Result<SmoothedTree> smoothed = smooth_for_seed(tree, options, progress);
  if (!smoothed) return fail(smoothed.error());
  Result<Seeded> seeded = seed_with_room(*std::move(smoothed), options, progress);
  if (!seeded) return fail(seeded.error());
  return std::move(seeded->model);
}

Result<SmoothedTree> smooth_for_seed(const CenterlineTree& tree, const SeedOptions& options,
                                     const Progress& progress) {
  Result<SmoothedTree> smoothed = smooth_centerlines(rounded(tree), options.smoothing, progress);
  if (!smoothed || !options.clearance) return smoothed;
  KeepApartOptions apart;
  apart.clearance = *options.clearance;
  return keep_apart(*std::move(smoothed), apart);
}

namespace {

Result<Model> checked(Result<Model> model) {
  if (!model) return model;
  if (auto error = find_defect(model->network)) return fail(*error);
  return model;
}

std::optional<Error> without_branches(const SmoothedTree& tree) {
  if (!tree.paths.empty()) return std::nullopt;
  return Error{ErrorKind::kBadInput, "the tree has no branches", tree.tree.source, {}, {}};
}

}  // namespace

Result<Model> seed_smoothed(const SmoothedTree& tree, const SeedOptions& options,
                            const Progress& progress) {
  if (const auto error = without_branches(tree)) return fail(*error);
  progress.at("plan", 0.0);
  Seeder seeder(tree, options, progress);
  return checked(seeder.run());
}

Result<Seeded> seed_with_room(SmoothedTree tree, const SeedOptions& options,
                              const Progress& progress) {
  if (const auto error = without_branches(tree)) return fail(*error);
  RoomMaker room(tree);
  BuiltByName known;
  int builds = 0;
  for (int round = 0;; ++round) {
    if (progress.should_stop()) return fail(cancelled("plan"));
    progress.at("plan", 0.0);
    Seeder seeder(tree, options, progress);
    const bool may_cut = round < kRoomRounds && builds < kRoomBuilds;
    const auto cut = [&](const std::vector<PlannedNode>& nodes) {
      bool any = false;
      for (const PlannedNode& node : nodes) any = room.cut(node) || any;
      if (any) tree = room.tree();
      return any;
    };
    if (may_cut && cut(seeder.crowded())) continue;
    ++builds;
    seeder.reuse(std::move(known));
    Result<Model> model = checked(seeder.run());
    if (!model) return fail(model.error());
    if (may_cut && cut(seeder.failed())) {
      known = seeder.built();
      continue;
    }
    return Seeded{*std::move(model), std::move(tree)};
  }
}

}  // namespace angiospline
