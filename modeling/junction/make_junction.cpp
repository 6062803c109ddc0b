#include <algorithm>
#include <array>
#include <numbers>
#include <optional>

#include <Eigen/Geometry>
#include <fmt/core.h>
#include <tbb/parallel_for.h>

#include "base/contract.h"
#include "modeling/junction/junction.h"
#include "modeling/junction/plan_openings.h"
#include "modeling/junction/quality.h"
#include "modeling/junction/rules.h"
#include "modeling/junction/smooth_junction.h"
#include "modeling/layout/layout.h"
#include "modeling/layout/target.h"
#include "modeling/layout/topology.h"

namespace angiospline {
namespace {

using namespace junction_rules;

// What comes before the solve.
struct Draft {
  JunctionTopology topology;
  JunctionTarget target;
  JunctionLayout layout;
};

struct Attempt {
  JunctionTopology topology;
  std::vector<OpeningFrame> openings;
  JunctionNet net;
  JunctionQuality quality;
};

// Of two sound surfaces.
bool is_better(const JunctionQuality& a, const JunctionQuality& b) {
  if (is_fair(a) != is_fair(b)) return is_fair(a);
  return departure(a) < departure(b);
}

// They differ in the solve alone.
bool share_draft(const LadderSetting& a, const LadderSetting& b) {
  return a.blend == b.blend && a.rounding == b.rounding && a.area_weight == b.area_weight &&
         a.merge_deg == b.merge_deg && a.follow == b.follow && a.sweeps == b.sweeps;
}

Draft make_draft(const OpeningPlan& plan, const LadderSetting& setting) {
  JunctionTopology topology =
      junction_topology(plan.directions(), setting.merge_deg * std::numbers::pi / 180);
  JunctionTarget target(plan.branches, setting.blend * plan.blend,
                        setting.rounding * plan.rounding);
  LayoutOptions options;
  options.area_weight = setting.area_weight;
  options.follow = setting.follow;
  options.coarse_sweeps = setting.sweeps;
  JunctionLayout layout = relaxed_layout(topology, target, plan.distances, options);
  return {std::move(topology), std::move(target), std::move(layout)};
}

Attempt attempt(const Draft& draft, const LadderSetting& setting, SmoothingWeights weights = {}) {
  weights.energy.anchor *= setting.anchor;
  SmoothedNet smooth = smooth_junction(draft.topology, draft.target, draft.layout, weights);
  const JunctionQuality quality = junction_quality(draft.topology, draft.target, smooth.net);
  return {draft.topology, draft.layout.openings, std::move(smooth.net), quality};
}

// The attempts of all settings, in their order and made when they are asked for.
class Attempts {
 public:
  Attempts(const OpeningPlan& plan, std::size_t at_a_time) : plan_(plan), at_a_time_(at_a_time) {}

  Attempt take(std::size_t k) {
    if (k == first_ + ready_.size()) make_next(k);
    return std::move(*ready_[k - first_]);
  }

 private:
  void make_next(std::size_t k) {
    first_ = k;
    ready_.clear();
    ready_.resize(std::min(at_a_time_, kLadder.size() - k));
    if (ready_.size() == 1) {
      if (k == 0 || !draft_ || !share_draft(kLadder[k - 1], kLadder[k])) {
        draft_ = make_draft(plan_, kLadder[k]);
      }
      ready_.front() = attempt(*draft_, kLadder[k]);
      return;
    }
    tbb::parallel_for(std::size_t{0}, ready_.size(), [&](std::size_t i) {
      ready_[i] = attempt(make_draft(plan_, kLadder[k + i]), kLadder[k + i]);
    });
  }

  const OpeningPlan& plan_;
  std::size_t at_a_time_;
  std::size_t first_ = 0;
  std::vector<std::optional<Attempt>> ready_;
  std::optional<Draft> draft_;  // of the setting before
};

SurfaceNetwork make_network(const JunctionSpec& spec, const OpeningPlan& plan,
                            const JunctionTopology& topology, const JunctionNet& net) {
  SurfaceNetwork network;
  network.control_points_mm = (plan.unit_mm * net.points).colwise() + spec.center_mm;

  double smallest = spec.branches.front().radius_mm;
  for (const JunctionBranch& b : spec.branches) smallest = std::min(smallest, b.radius_mm);
  network.regions.push_back({"junction_" + spec.name, RegionKind::kJunction, smallest});

  const KnotVector knots = KnotVector::bezier(5);
  const SharedGrid grid(topology, 6);

  // Each patch meets the next around its branch, and the one across its saddle, head to tail.
  for (int p = 0; p < static_cast<int>(topology.patches.size()); ++p) {
    Patch patch{knots, knots, {}, 0};
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) patch.control.push_back(grid.at(p, i, j));
    }
    network.patches.push_back(std::move(patch));
    const int next = topology.patches[static_cast<std::size_t>(p)].next;
    network.joins.push_back({{p, PatchSide::kV1}, {next, PatchSide::kV0}, false});
  }
  for (const JunctionSaddle& s : topology.saddles) {
    network.joins.push_back({{s.patch_a, PatchSide::kU1}, {s.patch_b, PatchSide::kU1}, true});
  }
  return network;
}

Junction make_result(const JunctionSpec& spec, const OpeningPlan& plan, const Attempt& best,
                     int attempts) {
  Junction junction;
  junction.network = make_network(spec, plan, best.topology, best.net);

  for (std::size_t b = 0; b < spec.branches.size(); ++b) {
    const OpeningFrame& frame = best.openings[b];
    JunctionOpening opening;
    opening.axis = frame.axis;
    opening.center_mm = spec.center_mm + plan.unit_mm * frame.center;
    opening.radius_mm = spec.branches[b].radius_mm;
    for (const double seam : frame.seams_rad) opening.seams.push_back(frame.direction(seam));
    opening.patches = best.topology.sectors[b];
    junction.openings.push_back(std::move(opening));
  }

  junction.worst_angle_deg = best.quality.worst_angle_deg;
  junction.jacobian_ratio = best.quality.jacobian_ratio;
  junction.curvature_times_radius = best.quality.curvature_times_radius;
  junction.distance_over_radius = best.quality.distance_to_union;
  junction.moved_over_radius = best.quality.off_target;
  junction.fair = is_fair(best.quality);
  junction.attempts = attempts;
  return junction;
}

}  // namespace

Result<Junction> make_junction(const JunctionSpec& spec, const JunctionOptions& options,
                               const Progress& progress) {
  EXPECTS(options.settings > 0);
  const Result<OpeningPlan> plan = plan_openings(spec, options);
  if (!plan) return fail(plan.error());

  std::optional<Attempt> best;  // a fair one, otherwise a sound one, otherwise none
  std::string why;
  const bool many = spec.branches.size() >= kMany;
  const double most_curvature = spec.branches.size() == 3 ? kGentle : kGentleOfMany;
  Attempts attempts(*plan, many ? kAtATime : 1);
  int count = 0;
  int more = many ? kMoreTriesOfMany : kMoreTries;
  const auto settings = std::min(kLadder.size(), static_cast<std::size_t>(options.settings));

  // Down the ladder, until a further setting could hardly be better.
  for (std::size_t k = 0; k < settings; ++k) {
    if (progress.should_stop()) return fail(cancelled("junction " + spec.name));
    if (best && is_fair(best->quality) && more-- == 0) break;
    ++count;
    Attempt now = attempts.take(k);
    if (why.empty()) why = failed_gate(now.quality);
    if (is_sound(now.quality) && (!best || is_better(now.quality, best->quality))) {
      best = std::move(now);
    }
    if (best && is_faithful(best->quality, most_curvature)) break;
  }

  if (best) return make_result(spec, *plan, *best, count);
  std::string names;
  for (const JunctionBranch& b : spec.branches) names += (names.empty() ? "" : ", ") + b.name;
  return fail({ErrorKind::kFailed, "no setting gives a smooth junction",
               "junction " + spec.name + " of " + names, why,
               fmt::format("{} settings tried", count)});
}

Result<Junction> make_rough_junction(const JunctionSpec& spec, const JunctionOptions& options) {
  const Result<OpeningPlan> plan = plan_openings(spec, options);
  if (!plan) return fail(plan.error());
  SmoothingWeights weights;
  weights.degrees.leg = 0;
  return make_result(spec, *plan,
                     attempt(make_draft(*plan, kLadder.front()), kLadder.front(), weights), 1);
}

}  // namespace angiospline
