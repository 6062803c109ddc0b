// The rules by which a tree is divided into junctions and bodies, and built. "Radii" are local: of
// the branch, opening or body the rule speaks of. docs/building.md says what each step does with
// them and what the whole was measured on.
#pragma once

#include <array>
#include <cstddef>

namespace angiospline {

// How paths are sampled and places on them found.
struct PlanRules {
  static constexpr double kSamplesPerRadius = 6;  // of a planned branch, to each mean radius
  static constexpr int kFewestSamples = 12;
  static constexpr int kMostSamples = 1'000'000;
  // A path that begins away from a centre passes it no farther on than this many times its
  // distance.
  static constexpr double kPassing = 3.0;
  static constexpr double kRounding = 1e-9;  // share of a length that is no difference
};

// Where the openings of a junction lie (plan_measures.cpp).
struct OpeningRules {
  // The least a junction may get along a branch, against what JunctionOptions ask for.
  static constexpr double kLeastMargin = 0.3;  // radii of an opening beyond the blend
  static constexpr double kLeastBlend = 0.4;   // share of the blend
  // A branch that begins farther than this from its node's centre was moved to it by merging...
  static constexpr double kMergedOffset = 0.2;  // radii
  // ... and is aimed at, at first, so far beyond where it begins.
  static constexpr double kPartingRadii = 0.5;
  // From so many branches of a merged node on their rays begin where they do: seen from the centre
  // they would part only far out.
  static constexpr std::size_t kManyBranches = 6;

  // The fixed point of directions and distances.
  static constexpr int kDirectionRounds = 16;
  static constexpr int kMostRefused = 8;      // rounds in which no openings exist
  static constexpr int kDamped = 3;           // from this round on steps are halved,
  static constexpr int kBisected = 5;         // from this one on brackets are bisected
  static constexpr double kSettled = 0.02;    // radii between rounds that are no change
  static constexpr double kFarther = 1.5;     // factor on distances that allow no openings
  static constexpr double kMeetsLater = 0.5;  // radii, and where the path is met moves out by this
};

// What openings ask of the bodies behind them, as one number that is compared between plans
// (plan_relief.cpp): radians of turn, and everything else weighed against them.
struct StrainRules {
  static constexpr double kOnItsPath = 0.25;      // radii between opening and branch: no strain
  static constexpr double kAllowedSag = 0.4;      // radii between branch and its chord: no strain
  static constexpr double kSagStrain = 0.5;       // for each radius more
  static constexpr double kBendStep = 0.25;       // radii between places where bends are measured,
  static constexpr double kBendReach = 4.0;       // and radii behind the opening up to which
  static constexpr double kBendStrain = 1.0;      // of curvature times radius beyond kTightestBend
  static constexpr double kOverlapStrain = 0.6;   // of two that still overlap behind their openings
  static constexpr double kLookedAhead = 8.0;     // radii behind the openings, for overlaps
  static constexpr std::size_t kFewBranches = 3;  // up to which branches can be led apart
  static constexpr double kUnmeasured = 10.0;     // strain where no openings can be found
};

// Which other plans of a junction are tried where it strains its bodies (plan_relief.cpp).
struct ReliefRules {
  static constexpr double kStrained = 0.6;      // strain that is worth looking for something better
  static constexpr double kMoveStrain = 0.04;   // for each radius by which the centre is moved
  static constexpr double kWorthMoving = 0.15;  // strain by which a plan must be better
  static constexpr double kSharedAngle = 1.0;   // radians between branches that leave together
  static constexpr int kSharedRadii = 8;        // of their way that the centre may move along
  static constexpr double kMostOfABranch = 0.45;  // share of its length that a junction may take
  // Distances that are tried, against those wanted: of two that overlap, and of the worst opening.
  static constexpr std::array<double, 5> kBothFarther{1.3, 1.7, 2.2, 3.0, 4.0};
  static constexpr std::array<double, 5> kOneFarther{1.2, 1.5, 2.0, 2.5, 3.0};
  // And nearer: 0 is the least distance, 1 the wanted one.
  static constexpr std::array<double, 2> kOneNearer{0.5, 0.0};
};

// Branches that bend inside their junction (plan_bends.cpp).
struct InnerBendRules {
  static constexpr double kCostly = 0.9;        // cost of a body that is worth the search
  static constexpr double kWorthBending = 0.2;  // by which strain and cost must become less
  static constexpr std::size_t kStarts = 4;     // the centre as it is, and the best of the others
  static constexpr double kNearly = 0.4;        // worse than the best, and still kept
  // What a body would cost: 1 for each radius between axis and path, or for kNarrowedCost.
  static constexpr double kCostReach = 12.0;     // radii of body that are looked at
  static constexpr double kCostSamples = 6.0;    // to each of them
  static constexpr double kNarrowedCost = 0.05;  // share of the radius given up
  static constexpr double kMostCost = 4.0;       // what is worse is as bad
  // Where on its path a ray begins (share of the way to its opening), and how far out that lies.
  static constexpr std::array<double, 5> kBentAt{0.0, 0.3, 0.5, 0.7, 0.8};
  static constexpr std::array<double, 6> kFarther{1.0, 1.2, 1.5, 2.0, 2.5, 3.0};
};

// How a branch's length is shared out, and what is done where it is too short (plan_room.cpp,
// plan_edits.cpp, plan_settling.cpp).
struct RoomRules {
  static constexpr double kLeastBody = 0.4;         // length of a body, in radii
  static constexpr double kLeastStraight = 0.15;    // and of one that is straight
  static constexpr double kWorthTightening = 0.05;  // radii by which an opening must come nearer
  static constexpr double kStraightEnough = 0.7;    // chord over arc of what may be taken straight
  static constexpr double kDeepestSag = 0.75;       // radii between a branch and the chord for it
  static constexpr double kLeastForward = 0.1;  // cosine to the chord; steeper slopes count as this
  static constexpr double kLongestExtension = 4;  // radii, of a free end within its junction
  // A loop is no hole if its far side lies within so many times the junction's largest radius and
  // its own.
  static constexpr double kInnerLoop = 3.0;
  static constexpr int kPlanRounds = 64;  // of measuring and changing; a bound, seldom reached
};

// What is tried when junctions or bodies fail, in rounds (build_model.cpp, built_junction.cpp).
struct RetryRules {
  static constexpr int kJunctionRounds = 6;  // of building, and changing the plan of what failed
  // Mean radii by which a centre moves forward in the first rounds, each on top of the last.
  static constexpr std::array<double, 3> kForwardRadii{1.0, 2.0, 4.0};
  static constexpr int kBendRounds = 5;         // of letting branches bend inside their junctions
  static constexpr double kReachFarther = 1.6;  // factor on where directions are taken
  static constexpr double kMergeReach = 6.0;    // radii of branch between what may be merged
  static constexpr int kMergePasses = 3;        // of merging junctions between which a body folds
  static constexpr int kFewSettings = 3;        // for a junction inside which branches bend
  static constexpr double kWiderMargin = 1.6;   // factor on the margin of a junction that failed
  // Junctions of several: more branches than this are cut, up to this many may be merged on.
  static constexpr std::size_t kCrowded = 6;
  static constexpr std::size_t kMayGrow = 5;
  static constexpr int kRoomRounds = 24;  // of cutting junctions and planning again,
  static constexpr int kRoomBuilds = 5;   // and of building what was planned
};

// Vessels thinned for want of room (make_room.cpp).
struct ThinningRules {
  static constexpr double kFullRadii = 2.0;   // along the tree from a node on: all of its share
  static constexpr double kFadeRadii = 3.0;   // and from there on less and less
  static constexpr double kMostAtOnce = 0.8;  // factor that one cut leaves at least: it changes the
                                              // whole plan
  static constexpr double kSpare = 0.97;      // of the length that is lacking
  static constexpr double kWorthNaming = 1e-3;  // share of a radius
  static constexpr int kPlacesPerRadius = 2;    // at which the way along a branch is measured
  static constexpr int kFewestPlaces = 8;
};

// The bodies of a plan (planned_body.cpp).
struct PlannedBodyRules {
  static constexpr double kFarFromCenterline = 0.5;  // radii that are worth a warning
  static constexpr double kFolded = 0.02;  // Jacobian ratio below which a body counts as folded
  static constexpr double kStraightened =
      6.0;  // radii of body that may be straightened if it folds
  static constexpr double kShortestPiece = 0.1;  // radii of body that are worth having
  static constexpr double kClearOfEnds =
      0.05;  // of both radii: samples nearer to an end are left out
  static constexpr double kRingOverlap = 0.25;  // of a ring's length, fitted beyond either end
  static constexpr int kRingSamples = 200;      // of each half of a ring
};

}  // namespace angiospline
