#include "modeling/junction/plan_openings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include <Eigen/Geometry>
#include <fmt/core.h>

#include "base/index.h"
#include "modeling/junction/rules.h"
#include "modeling/layout/rules.h"

namespace angiospline {
namespace {

using namespace junction_rules;

std::string junction_name(const JunctionSpec& spec) {
  return spec.name.empty() ? "junction" : "junction " + spec.name;
}

std::string branch_name(const JunctionSpec& spec, std::size_t b) {
  return spec.branches[b].name.empty() ? fmt::format("branch {}", b) : spec.branches[b].name;
}

std::optional<Error> find_branch_defect(const JunctionSpec& spec, std::size_t b) {
  const JunctionBranch& branch = spec.branches[b];
  const std::string where = junction_name(spec) + ", " + branch_name(spec, b);
  if (!std::isfinite(branch.radius_mm) || branch.radius_mm <= 0) {
    return Error{ErrorKind::kBadInput, "radius is not positive", where,
                 fmt::format("{}", branch.radius_mm), "radii are positive and finite"};
  }

  const double length = branch.direction.norm();
  if (!(std::abs(length - 1) <= kUnitTolerance)) {
    return Error{ErrorKind::kBadInput, "direction is not a unit vector", where,
                 fmt::format("length {}", length), "directions have length 1"};
  }

  if (!branch.offset_mm.allFinite()) {
    return Error{ErrorKind::kBadInput, "offset is not finite", where, {}, {}};
  }
  if (std::isnan(branch.longest_mm) || branch.longest_mm < 0) {
    return Error{ErrorKind::kBadInput, "longest distance of an opening is negative", where,
                 fmt::format("{}", branch.longest_mm), "zero or more, zero for no bound"};
  }
  return std::nullopt;
}

// Where a branch is going: exactly its direction if it begins in the centre.
Vec3 seen_from_center(const JunctionBranch& branch, double reach_mm) {
  if (branch.offset_mm.isZero(0)) return branch.direction;
  return (branch.offset_mm + reach_mm * branch.direction).normalized();
}

std::optional<Error> find_spec_defect(const JunctionSpec& spec) {
  if (spec.branches.size() < 3) {
    return Error{ErrorKind::kBadInput, "too few branches for a junction", junction_name(spec),
                 fmt::format("{}", spec.branches.size()), "a junction has three or more"};
  }
  if (spec.branches.size() > layout_rules::kMostRays) {
    return Error{ErrorKind::kBadInput, "too many branches for a junction", junction_name(spec),
                 fmt::format("{}", spec.branches.size()),
                 fmt::format("at most {}", layout_rules::kMostRays)};
  }
  if (!spec.center_mm.allFinite()) {
    return Error{ErrorKind::kBadInput, "centre is not finite", junction_name(spec), {}, {}};
  }

  for (std::size_t b = 0; b < spec.branches.size(); ++b) {
    if (auto error = find_branch_defect(spec, b)) return error;
  }

  // Branches that begin beside the centre may be parallel and yet go different ways.
  double reach = 0;
  for (const JunctionBranch& b : spec.branches)
    reach = std::max(reach, kDirectionReach * b.radius_mm);
  for (std::size_t a = 0; a < spec.branches.size(); ++a) {
    for (std::size_t b = a + 1; b < spec.branches.size(); ++b) {
      const Vec3 d = seen_from_center(spec.branches[a], reach);
      const Vec3 e = seen_from_center(spec.branches[b], reach);
      const double angle = std::atan2(d.cross(e).norm(), d.dot(e));
      if (angle >= kLeastAngleRad) continue;
      return Error{ErrorKind::kBadInput, "two branches in the same direction", junction_name(spec),
                   fmt::format("{} and {}, {:.3g} degrees apart", branch_name(spec, a),
                               branch_name(spec, b), angle * 180 / std::numbers::pi),
                   "directions of a junction differ by a degree or more"};
    }
  }
  return std::nullopt;
}

// The distance along a branch, from where it begins, of its point this far from
// the centre.
double along_branch(const Vec3& offset, const Vec3& direction, double distance) {
  if (offset.isZero(0)) return distance;
  const double back = offset.dot(direction);
  const double rest = back * back - offset.squaredNorm() + distance * distance;
  return rest > 0 ? std::max(0.0, std::sqrt(rest) - back) : 0.0;
}

// The circle of a branch at some distance, where the others' share is looked at.
class OpeningCircle {
 public:
  OpeningCircle(const JunctionTarget& target, int b) : target_(target), branch_(b) {
    const TargetBranch& branch = target.branches()[index(b)];
    const Vec3 x = branch.direction.unitOrthogonal();
    const Vec3 y = branch.direction.cross(x);
    for (int k = 0; k < kCirclePoints; ++k) {
      const double phi = 2 * std::numbers::pi * k / kCirclePoints;
      arms_[index(k)] = branch.start + branch.radius * (std::cos(phi) * x + std::sin(phi) * y);
    }
  }

  // Whether it is too large anywhere; where it was the last time is looked at first.
  bool is_too_near(double distance) {
    const Vec3 way = distance * target_.branches()[index(branch_)].direction;
    for (int k = 0; k < kCirclePoints; ++k) {
      const int point = (worst_ + k) % kCirclePoints;
      if (target_.others_share(branch_, arms_[index(point)] + way) <= kLargestShare) continue;
      worst_ = point;
      return true;
    }
    return false;
  }

 private:
  const JunctionTarget& target_;
  int branch_;
  std::array<Vec3, kCirclePoints> arms_;
  int worst_ = 0;
};

// The least distance beyond which the others' share is small. Branches diverge,
// so the share falls once it has begun to; the search comes inward from a
// distance at which it is certainly small.
double blend_end(const JunctionTarget& target, int b) {
  OpeningCircle circle(target, b);
  const double radius = target.branches()[index(b)].radius;
  double far = radius;
  while (circle.is_too_near(far)) far *= 2;
  if (far == radius) return far;
  double near = far / 2;
  for (int k = 0; k < kOpeningHalvings; ++k) {
    const double middle = (near + far) / 2;
    (circle.is_too_near(middle) ? near : far) = middle;
  }
  return far;
}

}  // namespace

Vec3 place_on_branch_mm(const JunctionBranch& branch, double distance_mm) {
  return branch.offset_mm +
         along_branch(branch.offset_mm, branch.direction, distance_mm) * branch.direction;
}

std::vector<Vec3> OpeningPlan::directions() const {
  std::vector<Vec3> all;
  for (std::size_t b = 0; b < branches.size(); ++b) {
    all.push_back(branches[b].start.isZero(0) ? branches[b].direction : opening(b).normalized());
  }
  return all;
}

Result<OpeningPlan> plan_openings(const JunctionSpec& spec, const JunctionOptions& options) {
  if (auto error = find_spec_defect(spec)) return fail(*error);
  OpeningPlan plan;

  plan.unit_mm = 0;
  for (const JunctionBranch& b : spec.branches) plan.unit_mm = std::max(plan.unit_mm, b.radius_mm);
  for (const JunctionBranch& b : spec.branches) {
    plan.branches.push_back(
        {b.direction.normalized(), b.radius_mm / plan.unit_mm, b.offset_mm / plan.unit_mm, 0.0});
  }

  // With all of the blend, then with less of it.
  Error too_short;
  for (const double part : kBlendParts) {
    plan.blend = part * options.blend;
    plan.rounding = part * options.rounding;
    plan.distances.clear();
    const JunctionTarget target(plan.branches, plan.blend, plan.rounding);
    bool fits = true;
    for (std::size_t b = 0; b < spec.branches.size() && fits; ++b) {
      const double r = plan.branches[b].radius;
      const double end = blend_end(target, static_cast<int>(b));
      const TargetBranch& branch = plan.branches[b];
      const double longest =
          along_branch(branch.start, branch.direction, spec.branches[b].longest_mm / plan.unit_mm);
      double distance = end + options.margin * r;

      if (spec.branches[b].longest_mm > 0) distance = std::min(distance, longest);
      if (distance < end + std::min(kLeastMargin, options.margin) * r) {
        fits = false;
        too_short = Error{
            ErrorKind::kFailed, "branch is too short for its opening",
            junction_name(spec) + ", " + branch_name(spec, b),
            fmt::format("{:.4g} mm", spec.branches[b].longest_mm),
            fmt::format("at least {:.4g} mm are needed", (end + kLeastMargin * r) * plan.unit_mm)};
      }

      plan.distances.push_back(distance);
    }

    if (fits) return plan;
  }
  return fail(too_short);
}

Result<std::vector<double>> opening_distances_mm(const JunctionSpec& spec,
                                                 const JunctionOptions& options) {
  const Result<OpeningPlan> plan = plan_openings(spec, options);
  if (!plan) return fail(plan.error());
  std::vector<double> distances;
  for (std::size_t b = 0; b < spec.branches.size(); ++b) {
    const bool centered = plan->branches[b].start.isZero(0);
    const double distance = centered ? plan->distances[b] : plan->opening(b).norm();
    distances.push_back(distance * plan->unit_mm);
  }
  return distances;
}

}  // namespace angiospline
