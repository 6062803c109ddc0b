#include "modeling/build/plan.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <tbb/parallel_for.h>

#include "base/contract.h"
#include "base/index.h"
#include "modeling/build/plan_edits.h"
#include "modeling/build/plan_settling.h"
#include "modeling/build/rules.h"

namespace angiospline {
namespace {

PlannedBranch sample_branch(const SmoothedTree& tree, int b) {
  const CenterlineBranch& source = tree.tree.branches[index(b)];
  const BSplineCurve<4>& path = tree.paths[index(b)];
  const double first = path.knots().first();
  const double length = path.knots().last() - first;
  const double radius = source.radii_mm.mean();
  const int count =
      std::clamp(static_cast<int>(std::ceil(PlanRules::kSamplesPerRadius * length / radius)),
                 PlanRules::kFewestSamples, PlanRules::kMostSamples);

  PlannedBranch branch;
  branch.name = source.name;
  branch.from = source.from;
  branch.to = source.to;
  branch.samples.resize(4, count + 1);
  for (int i = 0; i <= count; ++i) branch.samples.col(i) = path.at(first + length * i / count);
  measure_length(branch);
  return branch;
}

// A branch's samples as one of its ends sees them: distance from a centre, and way from the end.
struct PathFrom {
  const PlannedBranch& branch;
  BranchEnd end;
  Vec3 center;

  Eigen::Index count() const { return branch.samples.cols(); }
  Eigen::Index column(Eigen::Index i) const { return end.at_end ? count() - 1 - i : i; }
  double away(Eigen::Index i) const {
    return (branch.samples.col(column(i)).head<3>() - center).norm();
  }
  double along(Eigen::Index i) const {
    const double a = branch.along_mm[index(column(i))];
    return end.at_end ? branch.length_mm() - a : a;
  }
};

}  // namespace

// ---------------------------------------------------------------- paths

void measure_length(PlannedBranch& branch) {
  branch.along_mm.assign(1, 0.0);
  for (Eigen::Index i = 1; i < branch.samples.cols(); ++i) {
    branch.along_mm.push_back(branch.along_mm.back() +
                              (branch.samples.col(i) - branch.samples.col(i - 1)).head<3>().norm());
  }
}

Vec4 PlannedBranch::at(double along) const {
  const auto above = std::upper_bound(along_mm.begin(), along_mm.end(), along);
  if (above == along_mm.begin()) return samples.col(0);
  if (above == along_mm.end()) return samples.rightCols<1>();
  const auto i = static_cast<Eigen::Index>(above - along_mm.begin());
  const double low = along_mm[index(i - 1)];
  const double f = (along - low) / (*above - low);
  return (1 - f) * samples.col(i - 1) + f * samples.col(i);
}

double PlannedBranch::along_nearest(BranchEnd end, const Vec3& center) const {
  const PathFrom path{*this, end, center};
  double nearest = path.away(0);
  const double reach = PlanRules::kPassing * nearest;
  double best = 0;
  for (Eigen::Index i = 1; i < path.count(); ++i) {
    if (path.along(i) > reach) break;
    const double away = path.away(i);
    if (away >= nearest) continue;
    nearest = away;
    best = path.along(i);
  }
  return best;
}

std::optional<double> PlannedBranch::along_at_distance(BranchEnd end, const Vec3& center,
                                                       double distance) const {
  const PathFrom path{*this, end, center};

  // A path that begins beside the centre comes nearer before it leaves: what counts is the way out.
  const double passing = along_nearest(end, center);
  Eigen::Index first = 0;
  while (first + 1 < path.count() && path.along(first) < passing) ++first;
  double before = path.away(first);
  if (before >= distance) return path.along(first);

  for (Eigen::Index i = first + 1; i < path.count(); ++i) {
    const double now = path.away(i);
    if (now >= distance) {
      const double f = (distance - before) / (now - before);
      return (1 - f) * path.along(i - 1) + f * path.along(i);
    }
    before = now;
  }
  return std::nullopt;
}

// ---------------------------------------------------------------- the plan

const PlannedBranch& Plan::branch(BranchEnd end) const { return branches[index(end.branch)]; }

PlannedNode& Plan::node(BranchEnd end) {
  return nodes[index(end.at_end ? branch(end).to : branch(end).from)];
}

const PlannedNode& Plan::node(BranchEnd end) const {
  return nodes[index(end.at_end ? branch(end).to : branch(end).from)];
}

std::size_t Plan::slot(BranchEnd end) const {
  const std::vector<BranchEnd>& ends = node(end).ends;
  const auto found = std::find_if(ends.begin(), ends.end(), [&](const BranchEnd& e) {
    return e.branch == end.branch && e.at_end == end.at_end;
  });
  EXPECTS(found != ends.end());
  return index(found - ends.begin());
}

Plan unsettled_plan(const SmoothedTree& tree, const JunctionOptions& options) {
  Plan plan;
  plan.options = options;
  for (const CenterlineNode& node : tree.tree.nodes) {
    plan.nodes.push_back({});
    plan.nodes.back().name = node.name;
    plan.nodes.back().center_mm = node.position_mm;
    plan.nodes.back().spec.name = node.name;
  }
  for (const int inlet : tree.tree.inlets) plan.nodes[index(inlet)].inlet = true;

  plan.branches.resize(tree.paths.size());
  tbb::parallel_for(std::size_t{0}, plan.branches.size(), [&](std::size_t b) {
    plan.branches[b] = sample_branch(tree, static_cast<int>(b));
  });
  for (int b = 0; b < static_cast<int>(plan.branches.size()); ++b) {
    for (const bool at_end : {false, true}) plan.node({b, at_end}).ends.push_back({b, at_end});
  }

  for (PlannedNode& node : plan.nodes) node.alive = !node.ends.empty();
  plan.dirty.assign(plan.nodes.size(), 1);
  return plan;
}

Plan make_plan(const SmoothedTree& tree, const JunctionOptions& options) {
  Plan plan = unsettled_plan(tree, options);
  for (int n = 0; n < static_cast<int>(plan.nodes.size()); ++n) join_through(plan, n);
  settle(plan);
  return plan;
}

}  // namespace angiospline
