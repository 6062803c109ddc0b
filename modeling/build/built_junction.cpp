#include "modeling/build/built_junction.h"

#include <algorithm>

#include "modeling/build/rules.h"

namespace angiospline {
namespace {

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

}  // namespace

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

BuiltJunction build_bent_junction(const PlannedNode& node, JunctionOptions options,
                                  const Progress& progress) {
  BuiltJunction built{node.spec, {}, node.error};
  if (node.error) return built;
  options.settings = std::min(options.settings, RetryRules::kFewSettings);
  Result<Junction> junction = make_junction(node.spec, options, progress);
  if (!junction) {
    built.error = junction.error();
  } else if (junction->fair) {
    built.junction = std::move(*junction);
  }
  return built;
}

BuiltJunction build_junction(const PlannedNode& node, const JunctionOptions& options,
                             const Progress& progress) {
  BuiltJunction built{node.spec, {}, node.error};
  if (node.error) return built;
  const bool is_centered =
      std::all_of(node.spec.branches.begin(), node.spec.branches.end(),
                  [](const JunctionBranch& b) { return b.offset_mm.isZero(0); });

  // First as if all branches met in the centre; then as planned, and if that was the same already,
  // with openings farther out.
  struct Try {
    bool as_planned;
    double margin;
  };
  const double wider = is_centered ? RetryRules::kWiderMargin : 1.0;
  for (const Try& next : {Try{is_centered, 1.0}, Try{true, wider}}) {
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

}  // namespace angiospline
