#include "modeling/build/plan.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "base/contract.h"
#include "base/index.h"
#include "modeling/body/path.h"

namespace angiospline {
namespace {

constexpr double kSamplesPerRadius = 6;
constexpr double kLeastBody = 0.4;       // length of a body, in radii
constexpr double kLeastStraight = 0.15;  // and of one that is straight
constexpr double kPassing = 3.0;         // times its distance within which a path passes a centre
constexpr double kRounding = 1e-9;
constexpr double kWorthTightening = 0.05;  // radii by which an opening must come nearer
constexpr double kStraightEnough = 0.7;    // chord over arc of a branch that may be taken straight
constexpr double kDeepestSag = 0.75;       // radii between a branch and the chord it is taken for
constexpr double kLongestExtension = 4;    // of a free end that lies within its junction, in radii
constexpr double kInnerLoop = 3.0;  // of the largest radius there and its own, to its far side
constexpr int kPlanRounds = 64;

double least_body(const PlannedBranch& branch) {
  return branch.straight ? kLeastStraight : kLeastBody;
}

PlannedBranch sample_branch(const SmoothedTree& tree, int b) {
  const CenterlineBranch& source = tree.tree.branches[index(b)];
  const BSplineCurve<4>& path = tree.paths[index(b)];
  const double first = path.knots().first();
  const double length = path.knots().last() - first;
  const double radius = source.radii_mm.mean();
  const int count =
      std::clamp(static_cast<int>(std::ceil(kSamplesPerRadius * length / radius)), 12, 1'000'000);
  PlannedBranch branch;
  branch.name = source.name;
  branch.from = source.from;
  branch.to = source.to;
  branch.samples.resize(4, count + 1);
  for (int i = 0; i <= count; ++i) branch.samples.col(i) = path.at(first + length * i / count);
  return branch;
}

void measure_length(PlannedBranch& branch) {
  branch.along_mm.assign(1, 0.0);
  for (Eigen::Index i = 1; i < branch.samples.cols(); ++i) {
    branch.along_mm.push_back(branch.along_mm.back() +
                              (branch.samples.col(i) - branch.samples.col(i - 1)).head<3>().norm());
  }
}

}  // namespace

// ---------------------------------------------------------------- paths

Vec4 PlannedBranch::at(double along) const {
  const auto above = std::upper_bound(along_mm.begin(), along_mm.end(), along);
  if (above == along_mm.begin()) return samples.col(0);
  if (above == along_mm.end()) return samples.rightCols<1>();
  const auto i = static_cast<Eigen::Index>(above - along_mm.begin());
  const double low = along_mm[static_cast<std::size_t>(i - 1)];
  const double f = (along - low) / (*above - low);
  return (1 - f) * samples.col(i - 1) + f * samples.col(i);
}

double PlannedBranch::along_nearest(BranchEnd end, const Vec3& center) const {
  const Eigen::Index n = samples.cols();
  const auto column = [&](Eigen::Index i) { return end.at_end ? n - 1 - i : i; };
  double nearest = (samples.col(column(0)).head<3>() - center).norm();
  const double reach = kPassing * nearest;
  double best = 0;
  for (Eigen::Index i = 1; i < n; ++i) {
    const double along = along_mm[static_cast<std::size_t>(column(i))];
    const double from_end = end.at_end ? length_mm() - along : along;
    if (from_end > reach) break;
    const double away = (samples.col(column(i)).head<3>() - center).norm();
    if (away >= nearest) continue;
    nearest = away;
    best = from_end;
  }
  return best;
}

std::optional<double> PlannedBranch::along_at_distance(BranchEnd end, const Vec3& center,
                                                       double distance) const {
  const Eigen::Index n = samples.cols();
  const auto column = [&](Eigen::Index i) { return end.at_end ? n - 1 - i : i; };
  const auto away = [&](Eigen::Index i) {
    return (samples.col(column(i)).head<3>() - center).norm();
  };
  const auto along = [&](Eigen::Index i) {
    const double a = along_mm[static_cast<std::size_t>(column(i))];
    return end.at_end ? length_mm() - a : a;
  };
  const double passing = along_nearest(end, center);
  Eigen::Index first = 0;
  while (first + 1 < n && along(first) < passing) ++first;
  double before = away(first);
  if (before >= distance) return along(first);
  for (Eigen::Index i = first + 1; i < n; ++i) {
    const double now = away(i);
    if (now >= distance) {
      const double f = (distance - before) / (now - before);
      return (1 - f) * along(i - 1) + f * along(i);
    }
    before = now;
  }
  return std::nullopt;
}

// ---------------------------------------------------------------- the plan's bookkeeping

PlannedNode& Plan::node_at(BranchEnd end) {
  const PlannedBranch& branch = branches_[index(end.branch)];
  return nodes_[index(end.at_end ? branch.to : branch.from)];
}

const PlannedNode& Plan::node_at(BranchEnd end) const {
  const PlannedBranch& branch = branches_[index(end.branch)];
  return nodes_[index(end.at_end ? branch.to : branch.from)];
}

int Plan::slot_of(BranchEnd end) const {
  const std::vector<BranchEnd>& ends = node_at(end).ends;
  for (std::size_t k = 0; k < ends.size(); ++k) {
    if (ends[k].branch == end.branch && ends[k].at_end == end.at_end) return static_cast<int>(k);
  }
  EXPECTS(false && "the branch ends at its node");
  return -1;
}

Plan::Plan(const SmoothedTree& tree, const JunctionOptions& options) : options_(options) {
  for (const CenterlineNode& node : tree.tree.nodes) {
    nodes_.push_back({});
    nodes_.back().name = node.name;
    nodes_.back().center_mm = node.position_mm;
    nodes_.back().spec.name = node.name;
  }
  for (const int inlet : tree.tree.inlets) nodes_[index(inlet)].inlet = true;
  branches_.resize(tree.paths.size());
  tbb::parallel_for(std::size_t{0}, branches_.size(), [&](std::size_t b) {
    branches_[b] = sample_branch(tree, static_cast<int>(b));
    measure_length(branches_[b]);
  });
  for (int b = 0; b < static_cast<int>(branches_.size()); ++b) {
    for (const bool at_end : {false, true}) node_at({b, at_end}).ends.push_back({b, at_end});
  }
  for (PlannedNode& node : nodes_) node.alive = !node.ends.empty();
  dirty_.assign(nodes_.size(), 1);
  for (int n = 0; n < static_cast<int>(nodes_.size()); ++n) join_through(n);
  settle();
}

void Plan::detach(BranchEnd end) {
  PlannedNode& node = node_at(end);
  node.ends.erase(node.ends.begin() + slot_of(end));
  node.forget_openings();
  node.alive = !node.ends.empty();
}

// A node of exactly two different branches is no node: they become one.
void Plan::join_through(int n) {
  PlannedNode& node = nodes_[index(n)];
  if (!node.alive || node.ends.size() != 2) return;
  const BranchEnd a = node.ends[0];
  const BranchEnd b = node.ends[1];
  if (a.branch == b.branch) return;
  PlannedBranch& first = branches_[index(a.branch)];
  PlannedBranch& second = branches_[index(b.branch)];
  // first runs to the node, second from it.
  Eigen::Matrix4Xd head = first.samples;
  Eigen::Matrix4Xd tail = second.samples;
  if (!a.at_end) head = head.rowwise().reverse().eval();
  if (b.at_end) tail = tail.rowwise().reverse().eval();
  const BranchEnd far{b.branch, !b.at_end};
  const int from = a.at_end ? first.from : first.to;
  const int to = b.at_end ? second.from : second.to;
  nodes_[index(from)].ends[index(slot_of({a.branch, !a.at_end}))] = {a.branch, false};
  nodes_[index(to)].ends[index(slot_of(far))] = {a.branch, true};
  first.samples.resize(4, head.cols() + tail.cols() - 1);
  first.samples << head, tail.rightCols(tail.cols() - 1);
  first.from = from;
  first.to = to;
  first.name += "+" + second.name;
  measure_length(first);
  second.alive = false;
  node.alive = false;
  node.ends.clear();
  dirty_[index(from)] = dirty_[index(to)] = 1;
}

void Plan::drop(int b, const std::string& why) {
  PlannedBranch& branch = branches_[index(b)];
  warnings_.push_back(
      {WarningCode::kBranchLeftOut, fmt::format("branch {} was left out: {}", branch.name, why)});
  const int from = branch.from;
  const int to = branch.to;
  detach({b, false});
  detach({b, true});
  branch.alive = false;
  dirty_[index(from)] = dirty_[index(to)] = 1;
  join_through(from);
  join_through(to);
}

void Plan::merge(int b, double fits, const std::string& why) {
  PlannedBranch& branch = branches_[index(b)];
  const int kept = branch.from;
  const int gone = branch.to;
  PlannedNode& a = nodes_[index(kept)];
  PlannedNode& c = nodes_[index(gone)];
  warnings_.push_back(
      {WarningCode::kJunctionsMerged,
       fmt::format("junctions {} and {} became one: {} {}", a.name, c.name, branch.name, why)});
  // Thick branches hold the new node near their own.
  const auto weight = [&](const PlannedNode& node) {
    double sum = 0;
    for (const BranchEnd& end : node.ends) {
      if (end.branch == b) continue;
      const PlannedBranch& other = branches_[index(end.branch)];
      const double r = other.at(end.at_end ? other.length_mm() : 0.0)(3);
      sum += r * r;
    }
    return sum;
  };
  const double wa = weight(a);
  const double wc = weight(c);
  const Vec4 place = branch.at(branch.length_mm() * wc / (wa + wc));
  detach({b, false});
  detach({b, true});
  branch.alive = false;
  a.center_mm = place.head<3>();
  a.name += "+" + c.name;
  a.spec.name = a.name;
  a.inlet = a.inlet || c.inlet;
  a.alive = true;
  a.merged = true;
  a.absorbed.push_back({b, fits});
  a.absorbed.insert(a.absorbed.end(), c.absorbed.begin(), c.absorbed.end());
  for (const BranchEnd& end : c.ends) {
    PlannedBranch& moved = branches_[index(end.branch)];
    (end.at_end ? moved.to : moved.from) = kept;
    a.ends.push_back(end);
  }
  c.ends.clear();
  c.alive = false;
  std::sort(a.ends.begin(), a.ends.end(), [](const BranchEnd& x, const BranchEnd& y) {
    return std::pair(x.branch, x.at_end) < std::pair(y.branch, y.at_end);
  });
  a.reach = 1.0;
  a.forget_openings();
  dirty_[index(kept)] = 1;
  for (const BranchEnd& end : a.ends) branches_[index(end.branch)].tried_straight = false;
  join_through(kept);
}

// Of two branches between the same two nodes, whose lumens are one along the way, the thinner goes:
// it is a tunnel of a noisy mask, or a line that was drawn twice. True if one went.
bool Plan::drop_twins(int n) {
  const std::vector<BranchEnd> ends = nodes_[index(n)].ends;
  const auto far_node = [&](const PlannedBranch& b) { return b.from == n ? b.to : b.from; };
  for (std::size_t i = 0; i < ends.size(); ++i) {
    for (std::size_t j = i + 1; j < ends.size(); ++j) {
      const PlannedBranch& a = branches_[index(ends[i].branch)];
      const PlannedBranch& b = branches_[index(ends[j].branch)];
      if (ends[i].branch == ends[j].branch || far_node(a) != far_node(b)) continue;
      bool apart = false;  // a hole between the two needs room beyond both walls
      for (const double f : {0.25, 0.5, 0.75}) {
        const Vec4 p = a.at(f * a.length_mm());
        const Vec4 q = b.at((a.from == b.from ? f : 1 - f) * b.length_mm());
        apart = apart || (p - q).head<3>().norm() > p(3) + q(3);
      }
      if (apart && !(a.straight && b.straight)) continue;
      const bool a_thinner = a.samples.row(3).mean() < b.samples.row(3).mean();
      const BranchEnd gone = a_thinner ? ends[i] : ends[j];
      const std::string& kept = a_thinner ? b.name : a.name;
      drop(gone.branch, fmt::format("it runs inside branch {}", kept));
      return true;
    }
  }
  return false;
}

// Where no openings can be found, a loop that does not come out of the lumens that meet there is
// why: both its ends lead to one place. The smallest such goes; true if there was one.
bool Plan::drop_inner_loop(int n) {
  const PlannedNode& node = nodes_[index(n)];
  if (!node.error) return false;
  const auto radius_at = [&](BranchEnd end) {
    const PlannedBranch& branch = branches_[index(end.branch)];
    return branch.at(end.at_end ? branch.length_mm() : 0.0)(3);
  };
  double widest = 0;
  for (const BranchEnd& end : node.ends) widest = std::max(widest, radius_at(end));
  int smallest = -1;
  double least = kInnerLoop;
  for (const BranchEnd& end : node.ends) {
    const PlannedBranch& branch = branches_[index(end.branch)];
    if (end.at_end || branch.from != branch.to) continue;
    const double far =
        (branch.samples.topRows<3>().colwise() - node.center_mm).colwise().norm().maxCoeff();
    const double reach = far / (widest + branch.samples.row(3).mean());
    if (reach < least) {
      least = reach;
      smallest = end.branch;
    }
  }
  if (smallest < 0) return false;
  drop(smallest, "a loop that lies inside its junction");
  return true;
}

// A free end is moved outward along its last direction.
void Plan::extend(int b, double missing) {
  PlannedBranch& branch = branches_[index(b)];
  const bool at_end = nodes_[index(branch.to)].ends.size() == 1;
  Eigen::Matrix4Xd samples = branch.samples;
  if (!at_end) samples = samples.rowwise().reverse().eval();
  const Eigen::Index n = samples.cols();
  const Vec3 tip = samples.col(n - 1).head<3>();
  const Vec3 along = (tip - samples.col(std::max<Eigen::Index>(0, n - 4)).head<3>()).normalized();
  const double radius = samples(3, n - 1);
  const int steps = std::max(2, static_cast<int>(std::ceil(kSamplesPerRadius * missing / radius)));
  Eigen::Matrix4Xd longer(4, n + steps);
  longer.leftCols(n) = samples;
  for (int i = 1; i <= steps; ++i) {
    longer.col(n - 1 + i) << tip + missing * i / steps * along, radius;
  }
  branch.samples = at_end ? longer : Eigen::Matrix4Xd(longer.rowwise().reverse());
  measure_length(branch);
  warnings_.push_back(
      {WarningCode::kBranchLengthened,
       fmt::format("branch {} was made longer by {:.3g} mm: it ended within its junction",
                   branch.name, missing)});
}

// ---------------------------------------------------------------- room along branches

// How a branch's length is shared between the openings at its ends and the body.
struct Plan::Room {
  double length = 0;
  double least = 0;   // both openings at their nearest and the shortest body
  double wanted = 0;  // both openings where they like to be and the shortest body
  double radius = 0;  // mean of the openings'
  bool known = true;  // false: an end could not be measured
};

// Arc length from an end to its opening; 0 at a free end.
double Plan::end_along(int b, bool at_end, bool wanted) const {
  const BranchEnd end{b, at_end};
  const PlannedNode& node = node_at(end);
  if (!node.is_junction() || node.error) return 0.0;
  const auto k = index(slot_of(end));
  const double distance = std::max(wanted ? node.wanted_mm[k] : node.least_mm[k], node.meets_mm[k]);
  const PlannedBranch& branch = branches_[index(b)];
  if (branch.straight) return distance;
  // Beyond the end of the path every millimetre counts as one.
  const double farthest =
      (branch.at(at_end ? 0.0 : branch.length_mm()).head<3>() - node.center_mm).norm();
  return branch.along_at_distance(end, node.center_mm, distance)
      .value_or(branch.length_mm() + std::max(0.0, distance - farthest));
}

Plan::Room Plan::room_of(int b) const {
  const PlannedBranch& branch = branches_[index(b)];
  Room room;
  room.length =
      branch.straight
          ? (nodes_[index(branch.to)].center_mm - nodes_[index(branch.from)].center_mm).norm()
          : branch.length_mm();
  for (const bool at_end : {false, true}) {
    const BranchEnd end{b, at_end};
    const PlannedNode& node = node_at(end);
    room.known = room.known && !(node.is_junction() && node.error);
    room.least += end_along(b, at_end, false);
    room.wanted += end_along(b, at_end, true);
    room.radius += node.is_junction() && !node.error
                       ? node.spec.branches[index(slot_of(end))].radius_mm / 2
                       : branch.at(at_end ? branch.length_mm() : 0.0)(3) / 2;
  }
  const double body = least_body(branch) * room.radius;
  room.least += body;
  room.wanted += body;
  return room;
}

bool Plan::has_room(int b) const {
  const Room room = room_of(b);
  return room.known && room.length >= room.least * (1 - kRounding);
}

// Where an opening is planned: at its wanted distance along its direction.
double Plan::planned_mm(BranchEnd end) const { return node_at(end).wanted_mm[index(slot_of(end))]; }

// Curvature times radius that a body between two openings needs at least: that of the cubic between
// them with their axes as tangents. 0 where an end is not an opening.
double Plan::bend_of(int b) const {
  Vec3 place[2];
  Vec3 along[2];
  double radius = 0;
  for (const bool at_end : {false, true}) {
    const BranchEnd end{b, at_end};
    const PlannedNode& node = node_at(end);
    if (!node.is_junction() || node.error) return 0.0;
    const JunctionBranch& opening = node.spec.branches[index(slot_of(end))];
    place[at_end] = node.center_mm + place_on_branch_mm(opening, planned_mm(end));
    along[at_end] = at_end ? Vec3(-opening.direction) : opening.direction;
    radius = std::max(radius, opening.radius_mm);
  }
  const double length = (place[1] - place[0]).norm();
  const Vec3 chord = (place[1] - place[0]) / length;
  // Slopes against the chord; steep ones count as steeper still.
  const auto slope = [&](const Vec3& t) {
    const double forward = std::max(t.dot(chord), 0.1);
    return Vec3((t - t.dot(chord) * chord) / forward);
  };
  const Vec3 a = slope(along[0]);
  const Vec3 c = slope(along[1]);
  return std::max((4 * a + 2 * c).norm(), (2 * a + 4 * c).norm()) * radius / length;
}

// A branch without room for a body, or whose body would bend too tightly, is taken straight; if
// that gives no room either, it is taken as it was. True if the branch changed.
bool Plan::straighten(int b, const Room& room, double bend) {
  PlannedBranch& branch = branches_[index(b)];
  const PlannedNode& from = nodes_[index(branch.from)];
  const PlannedNode& to = nodes_[index(branch.to)];
  if (!from.is_junction() || !to.is_junction() || branch.from == branch.to) return false;
  const bool fits = room.length >= room.least * (1 - kRounding);
  if (branch.straight) {
    if (fits || branch.tried_straight) return false;
    branch.straight = false;
    branch.tried_straight = true;
    return true;
  }
  const double chord = (to.center_mm - from.center_mm).norm();
  if (branch.tried_straight || chord < kStraightEnough * branch.length_mm()) return false;
  if (fits && bend <= kTightestBend) return false;
  // The chord must stay well within the lumen of the branch it replaces.
  const Vec3 along = (to.center_mm - from.center_mm) / chord;
  for (const auto& sample : branch.samples.colwise()) {
    const Vec3 arm = sample.head<3>() - from.center_mm;
    if ((arm - arm.dot(along) * along).norm() > kDeepestSag * sample(3)) return false;
  }
  branch.straight = true;
  return true;
}

// What is done about a branch whose openings do not fit on it.
void Plan::make_room(int b, const Room& room) {
  const PlannedBranch& branch = branches_[index(b)];
  const bool from = nodes_[index(branch.from)].is_junction();
  const bool to = nodes_[index(branch.to)].is_junction();
  if (from && to && branch.from == branch.to) {
    drop(b, "a loop that lies inside its junction");
  } else if (from && to) {
    merge(b, room.length / room.least,
          fmt::format("is {:.3g} mm long and the two need {:.3g}", room.length, room.least));
  } else {
    const int node = from ? branch.from : branch.to;
    const double missing = room.least - room.length + kLeastBody * room.radius;
    if (missing > kLongestExtension * room.radius) {
      drop(b, fmt::format("it ends {:.3g} mm before the opening of its junction", missing));
      return;
    }
    extend(b, missing);
    dirty_[index(node)] = 1;
  }
}

void Plan::settle() {
  for (int round = 0; round < kPlanRounds; ++round) {
    for (int n = 0; n < static_cast<int>(nodes_.size()); ++n) {
      while (dirty_[index(n)] && nodes_[index(n)].is_junction() && drop_twins(n)) {
      }
    }
    std::vector<int> work;
    for (int n = 0; n < static_cast<int>(nodes_.size()); ++n) {
      if (dirty_[index(n)] && nodes_[index(n)].is_junction()) work.push_back(n);
    }
    if (work.empty()) {
      std::fill(dirty_.begin(), dirty_.end(), 0);
      if (!tighten()) return;
      continue;
    }
    std::vector<PlannedNode> measured(work.size());
    tbb::parallel_for(std::size_t{0}, work.size(), [&](std::size_t k) {
      measured[k] = nodes_[index(work[k])];
      measure(measured[k]);
      if (!measured[k].relieved) relieve(measured[k]);
    });
    for (std::size_t k = 0; k < work.size(); ++k) nodes_[index(work[k])] = std::move(measured[k]);
    std::vector<char> look(branches_.size(), 0);
    for (const int n : work) {
      for (const BranchEnd& end : nodes_[index(n)].ends) look[index(end.branch)] = 1;
    }
    std::fill(dirty_.begin(), dirty_.end(), 0);
    for (const int n : work) drop_inner_loop(n);

    struct Short {
      int branch;
      Room room;
    };
    std::vector<Short> shorts;
    for (int b = 0; b < static_cast<int>(branches_.size()); ++b) {
      if (!look[index(b)] || !branches_[index(b)].alive) continue;
      const Room room = room_of(b);
      if (!room.known) continue;
      if (straighten(b, room, 0.0)) {
        dirty_[index(branches_[index(b)].from)] = dirty_[index(branches_[index(b)].to)] = 1;
      } else if (room.length < room.least * (1 - kRounding)) {
        shorts.push_back({b, room});
      }
    }
    // The shortest first; what this round has already changed is measured again before more is
    // done.
    std::stable_sort(shorts.begin(), shorts.end(), [](const Short& x, const Short& y) {
      return x.room.length * y.room.least < y.room.length * x.room.least;
    });
    for (const Short& s : shorts) {
      const PlannedBranch& branch = branches_[index(s.branch)];
      if (!branch.alive || dirty_[index(branch.from)] || dirty_[index(branch.to)]) continue;
      make_room(s.branch, s.room);
    }
  }
  tighten();
}

// Shares the length of a branch between its openings and its body: each gets its least; what is
// left goes by the wishes, of which the body's is the length in which it can turn. True if an
// opening had to come nearer than planned.
bool Plan::share_room(int b) {
  const PlannedBranch& branch = branches_[index(b)];
  const Room room = room_of(b);
  if (!room.known) return false;
  const double body = least_body(branch) * room.radius;
  const double straight_part = std::max(room.length - room.wanted + body, body);
  const double turning = std::max(0.0, straight_part * bend_of(b) / kTightestBend - body);
  const double spare = room.length - room.least;
  const double wish = room.wanted - room.least + turning;
  bool nearer = false;
  for (const bool at_end : {false, true}) {
    const BranchEnd end{b, at_end};
    PlannedNode& node = node_at(end);
    if (!node.is_junction()) continue;
    const auto k = index(slot_of(end));
    const double least = end_along(b, at_end, false);
    const double own = end_along(b, at_end, true) - least;
    const double part = spare < wish ? std::max(0.0, spare) * own / wish : own + (spare - wish) / 2;
    const double along = least + part;
    const Vec3 place = branch.at(at_end ? branch.length_mm() - along : along).head<3>();
    const double distance = branch.straight ? along : (place - node.center_mm).norm();
    const double longest =
        std::max(std::min(distance, node.caps_mm[k]), node.least_mm[k] * (1 + kRounding));
    node.spec.branches[k].longest_mm = longest;
    if (longest < node.wanted_mm[k] - kWorthTightening * node.spec.branches[k].radius_mm) {
      node.caps_mm[k] = longest;
      dirty_[index(at_end ? branch.to : branch.from)] = 1;
      nearer = true;
    }
  }
  return nearer;
}

// Shares out the room of every branch; directions of openings that came nearer are measured again.
bool Plan::tighten() {
  bool again = false;
  for (int b = 0; b < static_cast<int>(branches_.size()); ++b) {
    if (!branches_[index(b)].alive) continue;
    const bool nearer = share_room(b);
    again = again || nearer;
    if (!nearer && straighten(b, room_of(b), bend_of(b))) {
      dirty_[index(branches_[index(b)].from)] = dirty_[index(branches_[index(b)].to)] = 1;
      again = true;
    }
  }
  return again;
}

void Plan::reach_farther(int n, double factor) {
  nodes_[index(n)].reach *= factor;
  nodes_[index(n)].caps_mm.clear();
  dirty_[index(n)] = 1;
}

// Along the mean of the branches' directions: seen from there they part at wider angles.
void Plan::move_forward(int n, double radii) {
  PlannedNode& node = nodes_[index(n)];
  Vec3 mean = Vec3::Zero();
  double radius = 0;
  for (const JunctionBranch& branch : node.spec.branches) {
    mean += branch.direction;
    radius += branch.radius_mm / static_cast<double>(node.spec.branches.size());
  }
  node.caps_mm.clear();
  node.center_mm += radii * radius * mean / static_cast<double>(node.spec.branches.size());
  dirty_[index(n)] = 1;
}

bool Plan::merge_along(int b) {
  const PlannedBranch& branch = branches_[index(b)];
  if (!branch.alive || branch.from == branch.to) return false;
  if (!nodes_[index(branch.from)].is_junction() || !nodes_[index(branch.to)].is_junction()) {
    return false;
  }
  merge(b, 0.0, "has a wall that folds between them");
  return true;
}

bool Plan::merge_with_nearest(int n, double radii) {
  int best = -1;
  double shortest = radii;
  const std::vector<BranchEnd>& ends = nodes_[index(n)].ends;
  // Of branches that lead to one other junction none has its length to itself: near that junction
  // all look the same way.
  const auto beside = [&](const PlannedBranch& branch) {
    return std::count_if(ends.begin(), ends.end(), [&](const BranchEnd& end) {
      const PlannedBranch& other = branches_[index(end.branch)];
      return std::minmax(other.from, other.to) == std::minmax(branch.from, branch.to);
    });
  };
  for (const BranchEnd& end : ends) {
    const PlannedBranch& branch = branches_[index(end.branch)];
    if (branch.from == branch.to || !nodes_[index(branch.from)].is_junction() ||
        !nodes_[index(branch.to)].is_junction()) {
      continue;
    }
    const double length =
        branch.length_mm() / branch.samples.row(3).mean() / static_cast<double>(beside(branch));
    if (length < shortest) {
      shortest = length;
      best = end.branch;
    }
  }
  if (best < 0) return false;
  merge(best, 0.0, "lies between junctions that could not be built apart");
  return true;
}

}  // namespace angiospline
