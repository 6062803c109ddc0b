#include "modeling/build/build_model.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <map>
#include <optional>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "base/contract.h"
#include "base/index.h"
#include "modeling/build/assembly.h"
#include "modeling/build/built_junction.h"
#include "modeling/build/make_room.h"
#include "modeling/build/plan.h"
#include "modeling/build/plan_bends.h"
#include "modeling/build/plan_edits.h"
#include "modeling/build/plan_settling.h"
#include "modeling/build/planned_body.h"
#include "modeling/build/rules.h"
#include "modeling/tree/clean_tree.h"
#include "modeling/tree/keep_apart.h"

namespace angiospline {
namespace {

// One attempt at a model: the plan of a tree, its junctions and bodies, and the rounds in which
// what failed is planned and built again.
class ModelBuilder {
 public:
  ModelBuilder(const SmoothedTree& tree, const BuildOptions& options, const Progress& progress)
      : tree_(tree),
        options_(options),
        progress_(progress),
        plan_(make_plan(tree, options.junction)) {
    find_flow();
    built_.resize(plan_.nodes.size());
    built_before_.resize(built_.size());
  }

  // Junctions of a former plan: those that are planned again as they were are not built again.
  void reuse(BuiltByName known) {
    for (std::size_t n = 0; n < built_.size(); ++n) {
      const auto found = known.find(plan_.nodes[n].spec.name);
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
    return merged_nodes(
        [&](std::size_t n) { return plan_.nodes[n].ends.size() > RetryRules::kCrowded; });
  }
  std::vector<PlannedNode> failed() const {
    return merged_nodes([&](std::size_t n) {
      const bool many = plan_.nodes[n].ends.size() > RetryRules::kMayGrow;
      return !built_[n].junction || (many && !built_[n].junction->fair);
    });
  }

  Result<Model> run() {
    find_bends(plan_);
    const Plan unbent = plan_;
    if (!let_branches_bend(unbent)) return fail(cancelled("junctions"));

    // Each pass starts from junctions that are all built or given up. A body that folds beside a
    // junction inside which branches bend has lost its room to it: that junction is planned as it
    // was. One that folds all the same makes one junction of its two.
    for (int merges = 0;;) {
      if (!build_junctions()) return fail(cancelled("junctions"));
      number_junctions();
      if (!build_bodies()) return fail(cancelled("bodies"));
      if (unbend_folded()) {
        plan_ = unbent;
        bent_ = bend(plan_, refused_);
        continue;
      }
      if (merges++ == RetryRules::kMergePasses || !merge_folded()) break;
    }

    progress_.at("assemble", 0.0);
    if (pieces_.empty() && junctions_.empty()) {
      return fail({ErrorKind::kFailed,
                   "nothing could be built",
                   tree_.tree.source,
                   failed_.empty() ? std::string() : failed_.front().why,
                   {}});
    }
    Model model = assembled();
    progress_.at("assemble", 1.0);
    return model;
  }

 private:
  template <typename Predicate>
  std::vector<PlannedNode> merged_nodes(const Predicate& is_wanted) const {
    std::vector<PlannedNode> nodes;
    for (std::size_t n = 0; n < built_.size(); ++n) {
      const PlannedNode& node = plan_.nodes[n];
      if (node.is_junction() && !node.absorbed.empty() && is_wanted(n)) nodes.push_back(node);
    }
    return nodes;
  }

  Model assembled() {
    Model model;
    model.network = assemble(junctions_, pieces_, closed_);
    model.tree = tree_.tree;
    model.assumptions = tree_.tree.assumptions;
    const std::array<const std::vector<Warning>*, 3> all{&tree_.warnings, &plan_.warnings,
                                                         &warnings_};
    for (const auto* warnings : all) {
      model.warnings.insert(model.warnings.end(), warnings->begin(), warnings->end());
    }
    warn_of_unfair_junctions(model);
    model.failed = std::move(failed_);
    return model;
  }

  // ---- junctions

  // Branches bend inside their junctions where that spares their bodies: one way after the other is
  // refused until all that remain can be built. After the last round nodes stay as they were. False
  // if stopped.
  bool let_branches_bend(const Plan& unbent) {
    refused_.assign(plan_.nodes.size(), 0);
    for (int round = 0; round < RetryRules::kBendRounds; ++round) {
      bent_ = bend(plan_, refused_);
      if (bent_.empty() || build_bent()) break;
      if (progress_.should_stop()) return false;
      plan_ = unbent;
      bent_.clear();
    }
    return true;
  }

  // Whether this node's junction, as it is planned now, has been built before; then it is there.
  bool is_built(int n) {
    const JunctionSpec& wanted = plan_.nodes[index(n)].spec;
    BuiltJunction& now = built_[index(n)];
    if (same(now.spec, wanted)) return true;

    // Plans come back: what was built for one is kept aside while another is tried.
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
          build_bent_junction(plan_.nodes[index(work[k])], options_.junction, progress_);
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
      const PlannedBranch& branch = plan_.branches[index(b)];
      for (const int n : {branch.from, branch.to}) {
        if (std::find(bent_.begin(), bent_.end(), n) == bent_.end()) continue;
        ++refused_[index(n)];
        any = true;
      }
    }
    return any;
  }

  // The junctions of the plan that were not built before, in parallel.
  void build_planned_junctions() {
    std::vector<int> work;
    for (int n = 0; n < static_cast<int>(plan_.nodes.size()); ++n) {
      if (plan_.nodes[index(n)].is_junction() && !is_built(n)) work.push_back(n);
    }
    std::atomic<std::size_t> done{0};
    tbb::parallel_for(std::size_t{0}, work.size(), [&](std::size_t k) {
      if (progress_.should_stop()) return;
      built_[index(work[k])] =
          build_junction(plan_.nodes[index(work[k])], options_.junction, progress_);
      progress_.at("junctions", static_cast<double>(++done) / static_cast<double>(work.size()));
    });
  }

  // Builds, changes the plan of what failed, and builds that again. False if stopped.
  bool build_junctions() {
    for (int round = 0; round < RetryRules::kJunctionRounds; ++round) {
      build_planned_junctions();
      if (progress_.should_stop()) return false;
      if (round + 1 == RetryRules::kJunctionRounds || !change_failed(round)) break;
    }
    return true;
  }

  // What fails mostly has all its branches on one side, where they part only slowly: its centre is
  // moved forward to where they do; then it is merged with its nearest neighbour; then directions
  // are taken farther out.
  bool change_failed(int round) {
    bool changed = false;
    for (int n = 0; n < static_cast<int>(built_.size()); ++n) {
      const PlannedNode& node = plan_.nodes[index(n)];
      if (!node.is_junction() || built_[index(n)].junction) continue;

      if (!node.absorbed.empty() && node.ends.size() > RetryRules::kMayGrow)
        continue;  // it is to be cut
      if (index(round) < RetryRules::kForwardRadii.size()) {
        move_forward(plan_, n, RetryRules::kForwardRadii[index(round)]);
        changed = true;
      } else if (merge_with_nearest(plan_, n, RetryRules::kMergeReach)) {
        changed = true;
      } else {
        reach_farther(plan_, n, RetryRules::kReachFarther);
        changed = true;
      }
    }

    if (changed) settle(plan_);
    return changed;
  }

  void number_junctions() {
    number_.assign(built_.size(), -1);
    junctions_.clear();
    failed_.clear();
    for (std::size_t n = 0; n < built_.size(); ++n) {
      const PlannedNode& node = plan_.nodes[n];
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
      model.warnings.push_back(
          {WarningCode::kJunctionNotFair,
           fmt::format(
               "{} is smooth but not fair: its curvature times the smallest radius is {:.3g}, and "
               "it departs from its branches by {:.2g} of that radius (below 20 and 0.5 are fair)",
               junction.network.regions.front().name, junction.curvature_times_radius,
               junction.distance_over_radius)});
    }
  }

  // ---- bodies

  // The bodies of all live branches, in parallel; then taken apart in the branches' order. False if
  // stopped.
  bool build_bodies() {
    const std::vector<PlannedBranch>& branches = plan_.branches;
    const BodySurroundings around{tree_, plan_, options_, junctions_, number_, flow_};
    std::vector<PlannedBody> outcomes(branches.size());
    std::atomic<std::size_t> done{0};
    tbb::parallel_for(std::size_t{0}, branches.size(), [&](std::size_t b) {
      if (!branches[b].alive || progress_.should_stop()) return;
      outcomes[b] = build_planned_body(around, static_cast<int>(b));
      progress_.at("bodies", static_cast<double>(++done) / static_cast<double>(branches.size()));
    });
    if (progress_.should_stop()) return false;

    pieces_.clear();
    closed_.clear();
    warnings_.clear();
    folded_.clear();
    for (std::size_t b = 0; b < outcomes.size(); ++b) {
      PlannedBody& outcome = outcomes[b];
      if (outcome.folded) folded_.push_back(static_cast<int>(b));
      for (BodyPiece& piece : outcome.pieces) pieces_.push_back(std::move(piece));
      for (ClosedOpening& closed : outcome.closed) closed_.push_back(std::move(closed));
      for (Warning& warning : outcome.warnings) warnings_.push_back(std::move(warning));
      if (outcome.failed) failed_.push_back(std::move(*outcome.failed));
    }
    return true;
  }

  // Junctions between which no body fits become one.
  bool merge_folded() {
    bool merged = false;
    for (const int b : folded_) merged = merge_along(plan_, b) || merged;
    if (merged) settle(plan_);
    return merged;
  }

  // Which nodes lie in a component with an inlet: only there is the direction of flow known.
  void find_flow() {
    const std::vector<int> component = components_of_nodes(tree_.tree);
    std::vector<char> fed(component.size() + 1, 0);
    for (const int inlet : tree_.tree.inlets) fed[index(component[index(inlet)])] = 1;
    for (const int c : component) flow_.push_back(fed[index(c)]);
  }

  const SmoothedTree& tree_;
  const BuildOptions& options_;
  const Progress& progress_;
  Plan plan_;
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
  std::vector<Warning> warnings_;
  std::vector<FailedPart> failed_;
};

}  // namespace

Result<Model> build_model(const CenterlineTree& tree, const BuildOptions& options,
                          const Progress& progress) {
  Result<SmoothedTree> smoothed = smooth_for_build(tree, options, progress);
  if (!smoothed) return fail(smoothed.error());
  Result<BuiltModel> built = build_with_room(*std::move(smoothed), options, progress);
  if (!built) return fail(built.error());
  return std::move(built->model);
}

Result<SmoothedTree> smooth_for_build(const CenterlineTree& tree, const BuildOptions& options,
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

Result<Model> build_smoothed(const SmoothedTree& tree, const BuildOptions& options,
                             const Progress& progress) {
  if (const auto error = without_branches(tree)) return fail(*error);
  progress.at("plan", 0.0);
  ModelBuilder builder(tree, options, progress);
  return checked(builder.run());
}

Result<BuiltModel> build_with_room(SmoothedTree tree, const BuildOptions& options,
                                   const Progress& progress) {
  if (const auto error = without_branches(tree)) return fail(*error);
  RoomMaker room(tree);
  const auto cut = [&](const std::vector<PlannedNode>& nodes) {
    bool any = false;
    for (const PlannedNode& node : nodes) any = room.cut(node) || any;
    if (any) tree = room.tree();
    return any;
  };

  // A plan tells soon which junctions swallow too many others, so these are cut before anything is
  // built; which of the others cannot be built is known only afterwards.
  BuiltByName known;
  int builds = 0;
  for (int round = 0;; ++round) {
    if (progress.should_stop()) return fail(cancelled("plan"));
    progress.at("plan", 0.0);
    ModelBuilder builder(tree, options, progress);
    const bool may_cut = round < RetryRules::kRoomRounds && builds < RetryRules::kRoomBuilds;
    if (may_cut && cut(builder.crowded())) continue;

    ++builds;
    builder.reuse(std::move(known));
    Result<Model> model = checked(builder.run());
    if (!model) return fail(model.error());
    if (may_cut && cut(builder.failed())) {
      known = builder.built();
      continue;
    }
    return BuiltModel{*std::move(model), std::move(tree)};
  }
}

}  // namespace angiospline
