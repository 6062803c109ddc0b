#include "modeling/build/plan_room.h"

#include <algorithm>
#include <array>

#include <Eigen/Geometry>

#include "base/index.h"
#include "modeling/body/path.h"
#include "modeling/build/rules.h"

namespace angiospline {
namespace {

bool is_measured(const PlannedNode& node) { return node.is_junction() && !node.error; }

// Arc length from an end to its opening, where that is wanted or at its nearest; 0 at a free end.
double along_to_opening(const Plan& plan, BranchEnd end, bool wanted) {
  const PlannedNode& node = plan.node(end);
  if (!is_measured(node)) return 0.0;
  const std::size_t k = plan.slot(end);
  const double distance = std::max(wanted ? node.wanted_mm[k] : node.least_mm[k], node.meets_mm[k]);
  const PlannedBranch& branch = plan.branch(end);
  if (branch.straight) return distance;

  // Beyond the end of the path every millimetre counts as one.
  const double farthest = (branch.at_from(end.opposite(), 0.0).head<3>() - node.center_mm).norm();
  return branch.along_at_distance(end, node.center_mm, distance)
      .value_or(branch.length_mm() + std::max(0.0, distance - farthest));
}

// Curvature times radius that a body between two openings needs at least: that of the cubic between
// them with their axes as tangents. 0 where an end is not an opening.
double bend_of(const Plan& plan, int b) {
  std::array<Vec3, 2> place;
  std::array<Vec3, 2> along;
  double radius = 0;
  for (const bool at_end : {false, true}) {
    const BranchEnd end{b, at_end};
    const PlannedNode& node = plan.node(end);
    if (!is_measured(node)) return 0.0;
    const std::size_t slot = plan.slot(end);
    const JunctionBranch& opening = node.spec.branches[slot];
    place[at_end] = node.center_mm + place_on_branch_mm(opening, node.wanted_mm[slot]);
    along[at_end] = at_end ? Vec3(-opening.direction) : opening.direction;
    radius = std::max(radius, opening.radius_mm);
  }

  // Slopes against the chord; steep ones count as steeper still.
  const double length = (place[1] - place[0]).norm();
  const Vec3 chord = (place[1] - place[0]) / length;
  const auto slope = [&](const Vec3& t) {
    const double forward = std::max(t.dot(chord), RoomRules::kLeastForward);
    return Vec3((t - t.dot(chord) * chord) / forward);
  };
  const Vec3 a = slope(along[0]);
  const Vec3 c = slope(along[1]);

  // The cubic Hermite curve over a chord of length 1 has these second derivatives at its ends, and
  // none larger between them.
  return std::max((4 * a + 2 * c).norm(), (2 * a + 4 * c).norm()) * radius / length;
}

// Whether the chord between two places stays well within the lumen of the branch.
bool chord_lies_inside(const PlannedBranch& branch, const Vec3& from, const Vec3& to,
                       double length) {
  const Vec3 along = (to - from) / length;
  for (const auto& sample : branch.samples.colwise()) {
    const Vec3 arm = sample.head<3>() - from;
    if ((arm - arm.dot(along) * along).norm() > RoomRules::kDeepestSag * sample(3)) return false;
  }
  return true;
}

void mark_both_ends(Plan& plan, const PlannedBranch& branch) {
  plan.dirty[index(branch.from)] = plan.dirty[index(branch.to)] = 1;
}

// What a branch's length leaves to each part: its least, and of the rest by the wishes, of which
// the body's is the length in which it can turn. True if an opening had to come nearer than
// planned.
bool share_room(Plan& plan, int b) {
  const PlannedBranch& branch = plan.branches[index(b)];
  const BranchRoom room = room_of(plan, b);
  if (!room.known) return false;
  const double straight_part = std::max(room.length - room.wanted + room.body, room.body);
  const double turning =
      std::max(0.0, straight_part * bend_of(plan, b) / kTightestBend - room.body);
  const double spare = room.length - room.least;
  const double wish = room.wanted - room.least + turning;

  bool nearer = false;
  for (const bool at_end : {false, true}) {
    const BranchEnd end{b, at_end};
    PlannedNode& node = plan.node(end);
    if (!node.is_junction()) continue;
    const std::size_t k = plan.slot(end);

    // Of too little each wish gets the same share; of too much the openings get what is over.
    const double least = along_to_opening(plan, end, false);
    const double own = along_to_opening(plan, end, true) - least;
    const double part = spare < wish ? std::max(0.0, spare) * own / wish : own + (spare - wish) / 2;
    const double along = least + part;

    const Vec3 place = branch.at_from(end, along).head<3>();
    const double distance = branch.straight ? along : (place - node.center_mm).norm();
    const double longest = std::max(std::min(distance, node.caps_mm[k]),
                                    node.least_mm[k] * (1 + PlanRules::kRounding));
    JunctionBranch& opening = node.spec.branches[k];
    opening.longest_mm = longest;
    if (longest < node.wanted_mm[k] - RoomRules::kWorthTightening * opening.radius_mm) {
      node.caps_mm[k] = longest;
      plan.dirty[index(at_end ? branch.to : branch.from)] = 1;
      nearer = true;
    }
  }
  return nearer;
}

}  // namespace

bool BranchRoom::fits() const { return length >= least * (1 - PlanRules::kRounding); }

BranchRoom room_of(const Plan& plan, int b) {
  const PlannedBranch& branch = plan.branches[index(b)];
  BranchRoom room;
  room.length =
      branch.straight
          ? (plan.nodes[index(branch.to)].center_mm - plan.nodes[index(branch.from)].center_mm)
                .norm()
          : branch.length_mm();

  // Openings from both ends; a free end takes nothing, but has a radius.
  for (const bool at_end : {false, true}) {
    const BranchEnd end{b, at_end};
    const PlannedNode& node = plan.node(end);
    room.known = room.known && !(node.is_junction() && node.error);
    room.least += along_to_opening(plan, end, false);
    room.wanted += along_to_opening(plan, end, true);
    room.radius += is_measured(node) ? node.spec.branches[plan.slot(end)].radius_mm / 2
                                     : branch.at_from(end, 0.0)(3) / 2;
  }

  room.body = (branch.straight ? RoomRules::kLeastStraight : RoomRules::kLeastBody) * room.radius;
  room.least += room.body;
  room.wanted += room.body;
  return room;
}

bool straighten(Plan& plan, int b, const BranchRoom& room, BendCheck check) {
  PlannedBranch& branch = plan.branches[index(b)];
  const PlannedNode& from = plan.nodes[index(branch.from)];
  const PlannedNode& to = plan.nodes[index(branch.to)];
  if (!from.is_junction() || !to.is_junction() || branch.from == branch.to) return false;

  // It is straight already, and no better off.
  if (branch.straight) {
    if (room.fits() || branch.tried_straight) return false;
    branch.straight = false;
    branch.tried_straight = true;
    mark_both_ends(plan, branch);
    return true;
  }

  // A short cut must be asked for, and must stay within the vessel.
  const double chord = (to.center_mm - from.center_mm).norm();
  if (branch.tried_straight) return false;
  if (chord < RoomRules::kStraightEnough * branch.length_mm()) return false;
  const double bend = check == BendCheck::kMeasure ? bend_of(plan, b) : 0.0;
  if (room.fits() && bend <= kTightestBend) return false;
  if (!chord_lies_inside(branch, from.center_mm, to.center_mm, chord)) return false;
  branch.straight = true;
  mark_both_ends(plan, branch);
  return true;
}

bool tighten(Plan& plan) {
  bool again = false;
  for (int b = 0; b < static_cast<int>(plan.branches.size()); ++b) {
    if (!plan.branches[index(b)].alive) continue;
    if (share_room(plan, b) || straighten(plan, b, room_of(plan, b), BendCheck::kMeasure)) {
      again = true;
    }
  }
  return again;
}

}  // namespace angiospline
