#include "modeling/build/plan_settling.h"

#include <algorithm>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "base/index.h"
#include "modeling/build/plan_edits.h"
#include "modeling/build/plan_measures.h"
#include "modeling/build/plan_relief.h"
#include "modeling/build/plan_room.h"
#include "modeling/build/rules.h"

namespace angiospline {
namespace {

bool is_work(const Plan& plan, int n) {
  return plan.dirty[index(n)] != 0 && plan.nodes[index(n)].is_junction();
}

// ---------------------------------------------------------------- branches without a lumen

// Whether a hole lies between two branches of the same two nodes: that needs room beyond both
// walls.
bool are_apart(const PlannedBranch& a, const PlannedBranch& b) {
  if (a.straight && b.straight) return false;
  bool apart = false;
  for (const double f : {0.25, 0.5, 0.75}) {
    const Vec4 p = a.at(f * a.length_mm());
    const Vec4 q = b.at((a.from == b.from ? f : 1 - f) * b.length_mm());
    apart = apart || (p - q).head<3>().norm() > p(3) + q(3);
  }
  return apart;
}

// Of two branches between the same two nodes, whose lumens are one along the way, the thinner goes:
// it is a tunnel of a noisy mask, or a line that was drawn twice. True if one went.
bool drop_twins(Plan& plan, int n) {
  const std::vector<BranchEnd> ends = plan.nodes[index(n)].ends;
  const auto far_node = [&](const PlannedBranch& b) { return b.from == n ? b.to : b.from; };
  for (std::size_t i = 0; i < ends.size(); ++i) {
    for (std::size_t j = i + 1; j < ends.size(); ++j) {
      const PlannedBranch& a = plan.branch(ends[i]);
      const PlannedBranch& b = plan.branch(ends[j]);
      if (ends[i].branch == ends[j].branch || far_node(a) != far_node(b)) continue;
      if (are_apart(a, b)) continue;

      const bool a_thinner = a.samples.row(3).mean() < b.samples.row(3).mean();
      const std::string why = fmt::format("it runs inside branch {}", a_thinner ? b.name : a.name);
      drop(plan, (a_thinner ? ends[i] : ends[j]).branch, why);
      return true;
    }
  }
  return false;
}

// Where no openings can be found, a loop that does not come out of the lumens that meet there is
// why: both its ends lead to one place. The smallest such goes.
void drop_inner_loop(Plan& plan, int n) {
  const PlannedNode& node = plan.nodes[index(n)];
  if (!node.error) return;
  double widest = 0;
  for (const BranchEnd& end : node.ends) {
    widest = std::max(widest, plan.branch(end).at_from(end, 0.0)(3));
  }

  int smallest = -1;
  double least = RoomRules::kInnerLoop;
  for (const BranchEnd& end : node.ends) {
    const PlannedBranch& branch = plan.branch(end);
    if (end.at_end || branch.from != branch.to) continue;
    const double far =
        (branch.samples.topRows<3>().colwise() - node.center_mm).colwise().norm().maxCoeff();
    const double reach = far / (widest + branch.samples.row(3).mean());
    if (reach < least) {
      least = reach;
      smallest = end.branch;
    }
  }
  if (smallest >= 0) drop(plan, smallest, "a loop that lies inside its junction");
}

// ---------------------------------------------------------------- one round

// The junctions whose openings are to be found.
std::vector<int> dirty_junctions(const Plan& plan) {
  std::vector<int> work;
  for (int n = 0; n < static_cast<int>(plan.nodes.size()); ++n) {
    if (is_work(plan, n)) work.push_back(n);
  }
  return work;
}

// Finds them. Each node is planned by itself and put in place afterwards, so that the result does
// not depend on which thread was first.
void measure_dirty(Plan& plan, const std::vector<int>& work) {
  std::vector<PlannedNode> found(work.size());
  tbb::parallel_for(std::size_t{0}, work.size(), [&](std::size_t k) {
    found[k] = measured(plan, plan.nodes[index(work[k])]);
    if (!found[k].relieved) found[k] = relieved(plan, std::move(found[k]));
  });
  for (std::size_t k = 0; k < work.size(); ++k) plan.nodes[index(work[k])] = std::move(found[k]);
}

// Which branches end at these nodes, in ascending order.
std::vector<int> branches_at(const Plan& plan, const std::vector<int>& nodes) {
  std::vector<int> branches;
  for (const int n : nodes) {
    for (const BranchEnd& end : plan.nodes[index(n)].ends) branches.push_back(end.branch);
  }
  std::sort(branches.begin(), branches.end());
  branches.erase(std::unique(branches.begin(), branches.end()), branches.end());
  return branches;
}

struct ShortBranch {
  int branch;
  BranchRoom room;
};

// Of these branches, the ones whose openings do not fit on them even straight; the shortest for its
// needs first.
std::vector<ShortBranch> shorts_of(Plan& plan, const std::vector<int>& branches) {
  std::vector<ShortBranch> shorts;
  for (const int b : branches) {
    if (!plan.branches[index(b)].alive) continue;
    const BranchRoom room = room_of(plan, b);
    if (!room.known || straighten(plan, b, room, BendCheck::kSkip)) continue;
    if (room.length < room.least * (1 - PlanRules::kRounding)) shorts.push_back({b, room});
  }
  std::stable_sort(shorts.begin(), shorts.end(), [](const ShortBranch& x, const ShortBranch& y) {
    return x.room.length * y.room.least < y.room.length * x.room.least;
  });
  return shorts;
}

// What is done about a branch whose openings do not fit on it.
void make_room_for(Plan& plan, int b, const BranchRoom& room) {
  const PlannedBranch& branch = plan.branches[index(b)];
  const bool from = plan.nodes[index(branch.from)].is_junction();
  const bool to = plan.nodes[index(branch.to)].is_junction();

  // Between two junctions nothing can be made longer.
  if (from && to && branch.from == branch.to) {
    drop(plan, b, "a loop that lies inside its junction");
    return;
  }
  if (from && to) {
    merge(plan, b, room.length / room.least,
          fmt::format("is {:.3g} mm long and the two need {:.3g}", room.length, room.least));
    return;
  }

  // A free end can: to its opening, and a body's length beyond.
  const double missing = room.least - room.length + RoomRules::kLeastBody * room.radius;
  if (missing > RoomRules::kLongestExtension * room.radius) {
    drop(plan, b, fmt::format("it ends {:.3g} mm before the opening of its junction", missing));
    return;
  }
  extend(plan, b, missing);
}

}  // namespace

void settle(Plan& plan) {
  for (int round = 0; round < RoomRules::kPlanRounds; ++round) {
    for (int n = 0; n < static_cast<int>(plan.nodes.size()); ++n) {
      while (is_work(plan, n) && drop_twins(plan, n)) {
      }
    }
    const std::vector<int> work = dirty_junctions(plan);
    if (work.empty()) {
      std::fill(plan.dirty.begin(), plan.dirty.end(), 0);
      if (!tighten(plan)) return;
      continue;
    }

    measure_dirty(plan, work);
    const std::vector<int> branches = branches_at(plan, work);
    std::fill(plan.dirty.begin(), plan.dirty.end(), 0);
    for (const int n : work) drop_inner_loop(plan, n);

    // What this round has already changed is measured again before more is done.
    for (const ShortBranch& s : shorts_of(plan, branches)) {
      const PlannedBranch& branch = plan.branches[index(s.branch)];
      const bool waits = plan.dirty[index(branch.from)] || plan.dirty[index(branch.to)];
      if (branch.alive && !waits) make_room_for(plan, s.branch, s.room);
    }
  }
  tighten(plan);
}

}  // namespace angiospline
