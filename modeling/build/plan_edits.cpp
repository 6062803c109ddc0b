#include "modeling/build/plan_edits.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "base/index.h"
#include "modeling/build/rules.h"

namespace angiospline {
namespace {

void detach(Plan& plan, BranchEnd end) {
  PlannedNode& node = plan.node(end);
  node.ends.erase(node.ends.begin() + static_cast<std::ptrdiff_t>(plan.slot(end)));
  node.forget_openings();
  node.alive = !node.ends.empty();
}

void take_out(Plan& plan, int b) {
  detach(plan, {b, false});
  detach(plan, {b, true});
  plan.branches[index(b)].alive = false;
}

// The sections of the branches that meet at a node, without branch `b`, over pi.
double sections_without(const Plan& plan, const PlannedNode& node, int b) {
  double sum = 0;
  for (const BranchEnd& end : node.ends) {
    if (end.branch == b) continue;
    const double r = plan.branch(end).at_from(end, 0.0)(3);
    sum += r * r;
  }
  return sum;
}

}  // namespace

void join_through(Plan& plan, int n) {
  PlannedNode& node = plan.nodes[index(n)];
  if (!node.alive || node.ends.size() != 2) return;
  const BranchEnd a = node.ends[0];
  const BranchEnd b = node.ends[1];
  if (a.branch == b.branch) return;
  PlannedBranch& first = plan.branches[index(a.branch)];
  PlannedBranch& second = plan.branches[index(b.branch)];

  // The first is turned so that it runs to the node, the second so that it runs from it.
  Eigen::Matrix4Xd head = first.samples;
  Eigen::Matrix4Xd tail = second.samples;
  if (!a.at_end) head = head.rowwise().reverse().eval();
  if (b.at_end) tail = tail.rowwise().reverse().eval();

  // The far nodes learn of it before the branches change: their slots are found by the old ends.
  const int from = a.at_end ? first.from : first.to;
  const int to = b.at_end ? second.from : second.to;
  plan.nodes[index(from)].ends[plan.slot(a.opposite())] = {a.branch, false};
  plan.nodes[index(to)].ends[plan.slot(b.opposite())] = {a.branch, true};

  first.samples.resize(4, head.cols() + tail.cols() - 1);
  first.samples << head, tail.rightCols(tail.cols() - 1);
  first.from = from;
  first.to = to;
  first.name += "+" + second.name;
  measure_length(first);
  second.alive = false;
  node.alive = false;
  node.ends.clear();
  plan.dirty[index(from)] = plan.dirty[index(to)] = 1;
}

void drop(Plan& plan, int b, const std::string& why) {
  const PlannedBranch& branch = plan.branches[index(b)];
  plan.warnings.push_back(
      {WarningCode::kBranchLeftOut, fmt::format("branch {} was left out: {}", branch.name, why)});
  const int from = branch.from;
  const int to = branch.to;
  take_out(plan, b);
  plan.dirty[index(from)] = plan.dirty[index(to)] = 1;
  join_through(plan, from);
  join_through(plan, to);
}

void merge(Plan& plan, int b, double fits, const std::string& why) {
  const PlannedBranch& branch = plan.branches[index(b)];
  const int kept = branch.from;
  PlannedNode& a = plan.nodes[index(kept)];
  PlannedNode& c = plan.nodes[index(branch.to)];
  plan.warnings.push_back(
      {WarningCode::kJunctionsMerged,
       fmt::format("junctions {} and {} became one: {} {}", a.name, c.name, branch.name, why)});

  // Thick branches hold the new node near their own.
  const double wa = sections_without(plan, a, b);
  const double wc = sections_without(plan, c, b);
  const Vec4 place = branch.at(branch.length_mm() * wc / (wa + wc));
  take_out(plan, b);
  a.center_mm = place.head<3>();
  a.name += "+" + c.name;
  a.spec.name = a.name;
  a.inlet = a.inlet || c.inlet;
  a.alive = true;
  a.merged = true;
  a.absorbed.push_back({b, fits});
  a.absorbed.insert(a.absorbed.end(), c.absorbed.begin(), c.absorbed.end());

  // In one order whichever of the two was there first, so that the same junction is built.
  for (const BranchEnd& end : c.ends) {
    PlannedBranch& moved = plan.branches[index(end.branch)];
    (end.at_end ? moved.to : moved.from) = kept;
    a.ends.push_back(end);
  }
  std::sort(a.ends.begin(), a.ends.end(), [](const BranchEnd& x, const BranchEnd& y) {
    return std::pair(x.branch, x.at_end) < std::pair(y.branch, y.at_end);
  });
  c.ends.clear();
  c.alive = false;

  // Nothing that was found for either holds for both.
  a.reach = 1.0;
  a.forget_openings();
  plan.dirty[index(kept)] = 1;
  for (const BranchEnd& end : a.ends) plan.branches[index(end.branch)].tried_straight = false;
  join_through(plan, kept);
}

void extend(Plan& plan, int b, double missing) {
  PlannedBranch& branch = plan.branches[index(b)];
  const bool at_end = plan.nodes[index(branch.to)].ends.size() == 1;
  Eigen::Matrix4Xd samples = branch.samples;
  if (!at_end) samples = samples.rowwise().reverse().eval();
  const Eigen::Index n = samples.cols();

  // The last direction over three samples: half a radius, so that one crooked step says little.
  const Vec3 tip = samples.col(n - 1).head<3>();
  const Vec3 along = (tip - samples.col(std::max<Eigen::Index>(0, n - 4)).head<3>()).normalized();
  const double radius = samples(3, n - 1);

  const int steps =
      std::max(2, static_cast<int>(std::ceil(PlanRules::kSamplesPerRadius * missing / radius)));
  Eigen::Matrix4Xd longer(4, n + steps);
  longer.leftCols(n) = samples;
  for (int i = 1; i <= steps; ++i) {
    longer.col(n - 1 + i) << tip + missing * i / steps * along, radius;
  }
  branch.samples = at_end ? longer : Eigen::Matrix4Xd(longer.rowwise().reverse());
  measure_length(branch);
  plan.dirty[index(at_end ? branch.from : branch.to)] = 1;
  plan.warnings.push_back(
      {WarningCode::kBranchLengthened,
       fmt::format("branch {} was made longer by {:.3g} mm: it ended within its junction",
                   branch.name, missing)});
}

void reach_farther(Plan& plan, int n, double factor) {
  plan.nodes[index(n)].reach *= factor;
  plan.nodes[index(n)].caps_mm.clear();
  plan.dirty[index(n)] = 1;
}

void move_forward(Plan& plan, int n, double radii) {
  PlannedNode& node = plan.nodes[index(n)];
  Vec3 mean = Vec3::Zero();
  double radius = 0;
  for (const JunctionBranch& branch : node.spec.branches) {
    mean += branch.direction;
    radius += branch.radius_mm / static_cast<double>(node.spec.branches.size());
  }
  node.caps_mm.clear();
  node.center_mm += radii * radius * mean / static_cast<double>(node.spec.branches.size());
  plan.dirty[index(n)] = 1;
}

bool merge_along(Plan& plan, int b) {
  const PlannedBranch& branch = plan.branches[index(b)];
  if (!branch.alive || branch.from == branch.to) return false;
  if (!plan.nodes[index(branch.from)].is_junction()) return false;
  if (!plan.nodes[index(branch.to)].is_junction()) return false;
  merge(plan, b, 0.0, "has a wall that folds between them");
  return true;
}

bool merge_with_nearest(Plan& plan, int n, double radii) {
  const std::vector<BranchEnd>& ends = plan.nodes[index(n)].ends;
  // Of branches that lead to one other junction none has its length to itself: near that junction
  // all look the same way.
  const auto beside = [&](const PlannedBranch& branch) {
    return std::count_if(ends.begin(), ends.end(), [&](const BranchEnd& end) {
      const PlannedBranch& other = plan.branch(end);
      return std::minmax(other.from, other.to) == std::minmax(branch.from, branch.to);
    });
  };

  int best = -1;
  double shortest = radii;
  for (const BranchEnd& end : ends) {
    const PlannedBranch& branch = plan.branch(end);
    if (branch.from == branch.to || !plan.nodes[index(branch.from)].is_junction() ||
        !plan.nodes[index(branch.to)].is_junction()) {
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
  merge(plan, best, 0.0, "lies between junctions that could not be built apart");
  return true;
}

}  // namespace angiospline
