#include "modeling/seed_plan.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "base/contract.h"

namespace angiospline {
namespace {

constexpr double kSamplesPerRadius = 6;
constexpr double kLeastMargin = 0.35;  // of an opening beyond the blend, in radii
constexpr double kLeastBody = 0.4;     // length of a body, in radii
constexpr double kBendingRoom = 3.0;   // a body shorter than this, in radii, had better be straight
constexpr double kStraightEnough = 0.7;  // chord over arc of a branch that may be taken straight
constexpr int kDirectionRounds = 8;
constexpr int kPlanRounds = 64;

std::size_t index(int i) { return static_cast<std::size_t>(i); }

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
  double before = away(0);
  if (before >= distance) return 0.0;
  for (Eigen::Index i = 1; i < n; ++i) {
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

PlannedNode& SeedPlan::node_at(BranchEnd end) {
  const PlannedBranch& branch = branches_[index(end.branch)];
  return nodes_[index(end.at_end ? branch.to : branch.from)];
}

const PlannedNode& SeedPlan::node_at(BranchEnd end) const {
  const PlannedBranch& branch = branches_[index(end.branch)];
  return nodes_[index(end.at_end ? branch.to : branch.from)];
}

int SeedPlan::slot_of(BranchEnd end) const {
  const std::vector<BranchEnd>& ends = node_at(end).ends;
  for (std::size_t k = 0; k < ends.size(); ++k) {
    if (ends[k].branch == end.branch && ends[k].at_end == end.at_end) return static_cast<int>(k);
  }
  EXPECTS(false && "the branch ends at its node");
  return -1;
}

SeedPlan::SeedPlan(const SmoothedTree& tree, const JunctionOptions& options) : options_(options) {
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

void SeedPlan::detach(BranchEnd end) {
  PlannedNode& node = node_at(end);
  node.ends.erase(node.ends.begin() + slot_of(end));
  node.alive = !node.ends.empty();
}

// A node of exactly two different branches is no node: they become one.
void SeedPlan::join_through(int n) {
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

void SeedPlan::drop(int b, const std::string& why) {
  PlannedBranch& branch = branches_[index(b)];
  warnings_.push_back(fmt::format("branch {} was left out: {}", branch.name, why));
  const int from = branch.from;
  const int to = branch.to;
  detach({b, false});
  detach({b, true});
  branch.alive = false;
  dirty_[index(from)] = dirty_[index(to)] = 1;
  join_through(from);
  join_through(to);
}

void SeedPlan::merge(int b, const std::string& why) {
  PlannedBranch& branch = branches_[index(b)];
  const int kept = branch.from;
  const int gone = branch.to;
  PlannedNode& a = nodes_[index(kept)];
  PlannedNode& c = nodes_[index(gone)];
  warnings_.push_back(
      fmt::format("junctions {} and {} became one: {} {}", a.name, c.name, branch.name, why));
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
  dirty_[index(kept)] = 1;
  join_through(kept);
}

// A free end is moved outward along its last direction.
void SeedPlan::extend(int b, double missing) {
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
      fmt::format("branch {} was made longer by {:.3g} mm: it ended within its junction",
                  branch.name, missing));
}

// ---------------------------------------------------------------- measuring junctions

// Directions are those from the centre to the openings' centres on the paths, whose distances
// depend on the directions: a fixed point, found by repetition (damped after a few rounds).
void SeedPlan::measure(PlannedNode& node) const {
  const std::size_t n = node.ends.size();
  std::vector<double> distance(n);
  node.spec.center_mm = node.center_mm;
  node.spec.branches.assign(n, {});
  node.error.reset();
  double widest = 0;
  for (const BranchEnd& end : node.ends) {
    const PlannedBranch& branch = branches_[index(end.branch)];
    widest = std::max(widest, branch.at(end.at_end ? branch.length_mm() : 0.0)(3));
  }
  distance.assign(n, 2 * widest);
  const auto aim = [&] {
    for (std::size_t k = 0; k < n; ++k) {
      const BranchEnd end = node.ends[k];
      const PlannedBranch& branch = branches_[index(end.branch)];
      const auto along = branch.along_at_distance(end, node.center_mm, node.reach * distance[k]);
      const double s = along.value_or(branch.length_mm());
      Vec4 target = branch.at(end.at_end ? branch.length_mm() - s : s);
      const double radius = target(3);
      if (branch.straight) target.head<3>() = node_at({end.branch, !end.at_end}).center_mm;
      const Vec3 chord = target.head<3>() - node.center_mm;
      node.spec.branches[k] = {branch.name, chord.normalized(), radius, 0.0};
    }
  };
  for (int round = 0; round < kDirectionRounds; ++round) {
    aim();
    const auto next = opening_distances_mm(node.spec, options_);
    if (!next) {
      // Branches that leave together part farther out.
      node.error = next.error();
      for (double& d : distance) d *= 1.5;
      continue;
    }
    node.error.reset();
    double change = 0;
    for (std::size_t k = 0; k < n; ++k) {
      const double to = round < 3 ? (*next)[k] : ((*next)[k] + distance[k]) / 2;
      change = std::max(change, std::abs(to - distance[k]) / node.spec.branches[k].radius_mm);
      distance[k] = to;
    }
    if (change < 0.02) break;
  }
  if (node.error) return;
  aim();
  JunctionOptions tight = options_;
  tight.margin = std::min(kLeastMargin, options_.margin);
  const auto wanted = opening_distances_mm(node.spec, options_);
  const auto least = opening_distances_mm(node.spec, tight);
  if (!wanted || !least) {
    node.error = wanted ? least.error() : wanted.error();
    return;
  }
  node.wanted_mm = *wanted;
  node.least_mm = *least;
}

// ---------------------------------------------------------------- room along branches

// How a branch's length is shared between the openings at its ends and the body.
struct SeedPlan::Room {
  double length = 0;
  double least = 0;   // both openings at their nearest and the shortest body
  double wanted = 0;  // both openings where they like to be and the shortest body
  double radius = 0;  // mean of the openings'
  bool known = true;  // false: an end could not be measured
};

// Arc length from an end to its opening; 0 at a free end.
double SeedPlan::end_along(int b, bool at_end, bool wanted) const {
  const BranchEnd end{b, at_end};
  const PlannedNode& node = node_at(end);
  if (!node.is_junction() || node.error) return 0.0;
  const auto k = index(slot_of(end));
  const double distance = wanted ? node.wanted_mm[k] : node.least_mm[k];
  const PlannedBranch& branch = branches_[index(b)];
  if (branch.straight) return distance;
  // Beyond the end of the path every millimetre counts as one.
  const double farthest =
      (branch.at(at_end ? 0.0 : branch.length_mm()).head<3>() - node.center_mm).norm();
  return branch.along_at_distance(end, node.center_mm, distance)
      .value_or(branch.length_mm() + std::max(0.0, distance - farthest));
}

SeedPlan::Room SeedPlan::room_of(int b) const {
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
  room.least += kLeastBody * room.radius;
  room.wanted += kLeastBody * room.radius;
  return room;
}

void SeedPlan::settle() {
  for (int round = 0; round < kPlanRounds; ++round) {
    std::vector<int> work;
    for (int n = 0; n < static_cast<int>(nodes_.size()); ++n) {
      if (dirty_[index(n)] && nodes_[index(n)].is_junction()) work.push_back(n);
    }
    tbb::parallel_for(std::size_t{0}, work.size(),
                      [&](std::size_t k) { measure(nodes_[index(work[k])]); });
    std::vector<char> look(branches_.size(), 0);
    for (const int n : work) {
      for (const BranchEnd& end : nodes_[index(n)].ends) look[index(end.branch)] = 1;
    }
    std::fill(dirty_.begin(), dirty_.end(), 0);

    struct Short {
      int branch;
      Room room;
    };
    std::vector<Short> shorts;
    for (int b = 0; b < static_cast<int>(branches_.size()); ++b) {
      PlannedBranch& branch = branches_[index(b)];
      if (!look[index(b)] || !branch.alive) continue;
      const Room room = room_of(b);
      if (!room.known) continue;
      const bool between = nodes_[index(branch.from)].is_junction() &&
                           nodes_[index(branch.to)].is_junction() && branch.from != branch.to;
      const double chord =
          (nodes_[index(branch.to)].center_mm - nodes_[index(branch.from)].center_mm).norm();
      if (between && !branch.straight && chord > kStraightEnough * branch.length_mm() &&
          room.length < room.least + kBendingRoom * room.radius) {
        branch.straight = true;
        dirty_[index(branch.from)] = dirty_[index(branch.to)] = 1;
        continue;
      }
      if (room.length < room.least) shorts.push_back({b, room});
    }
    std::stable_sort(shorts.begin(), shorts.end(), [](const Short& x, const Short& y) {
      return x.room.length * y.room.least < y.room.length * x.room.least;
    });
    for (const Short& s : shorts) {
      const PlannedBranch& branch = branches_[index(s.branch)];
      // What this round has already changed is measured again first.
      if (!branch.alive || dirty_[index(branch.from)] || dirty_[index(branch.to)]) continue;
      const bool from = nodes_[index(branch.from)].is_junction();
      const bool to = nodes_[index(branch.to)].is_junction();
      if (from && to && branch.from == branch.to) {
        drop(s.branch, "a loop that lies inside its junction");
      } else if (from && to) {
        merge(s.branch, fmt::format("is {:.3g} mm long and the two need {:.3g}", s.room.length,
                                    s.room.least));
      } else {
        extend(s.branch, s.room.least - s.room.length);
        dirty_[index(from ? branch.from : branch.to)] = 1;
      }
    }
    if (std::none_of(dirty_.begin(), dirty_.end(), [](char d) { return d != 0; })) break;
  }
  set_longest();
}

// What is left between two openings is shared so that neither passes the other.
void SeedPlan::set_longest() {
  for (int b = 0; b < static_cast<int>(branches_.size()); ++b) {
    const PlannedBranch& branch = branches_[index(b)];
    if (!branch.alive) continue;
    const Room room = room_of(b);
    if (!room.known) continue;
    const double spare = room.length - room.least;
    const double wish = room.wanted - room.least;
    for (const bool at_end : {false, true}) {
      const BranchEnd end{b, at_end};
      PlannedNode& node = node_at(end);
      if (!node.is_junction()) continue;
      const auto k = index(slot_of(end));
      const double own = end_along(b, at_end, true) - end_along(b, at_end, false);
      // In proportion to the wishes while they do not fit, half of the surplus each when they do.
      const double part = spare < wish ? spare * own / wish : own + (spare - wish) / 2;
      const double along = end_along(b, at_end, false) + part;
      const Vec3 place = branch.at(at_end ? branch.length_mm() - along : along).head<3>();
      const double distance = branch.straight ? along : (place - node.center_mm).norm();
      node.spec.branches[k].longest_mm = std::max(distance, node.least_mm[k] * (1 + 1e-9));
    }
  }
}

void SeedPlan::reach_farther(int n, double factor) {
  nodes_[index(n)].reach *= factor;
  dirty_[index(n)] = 1;
}

bool SeedPlan::merge_with_nearest(int n, double radii) {
  int best = -1;
  double shortest = radii;
  for (const BranchEnd& end : nodes_[index(n)].ends) {
    const PlannedBranch& branch = branches_[index(end.branch)];
    if (branch.from == branch.to || !nodes_[index(branch.from)].is_junction() ||
        !nodes_[index(branch.to)].is_junction()) {
      continue;
    }
    const double length = branch.length_mm() / branch.samples.row(3).mean();
    if (length < shortest) {
      shortest = length;
      best = end.branch;
    }
  }
  if (best < 0) return false;
  merge(best, "lies between junctions that could not be built apart");
  return true;
}

}  // namespace angiospline
