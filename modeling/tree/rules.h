// The rules by which centerlines are cleaned, smoothed and kept apart. "Radii" are local: those of
// the point or branch the rule speaks of. docs/centerlines.md says what each step does with them.
#pragma once

#include <cstddef>

#include <Eigen/Core>

namespace angiospline {

// What is one point, one vessel, one order (clean_tree.cpp, merge_lines.cpp, point_graph.cpp).
struct CleaningRules {
  // Points closer than this, in radii, are one: below any quantisation, above rounding.
  static constexpr double kSamePoint = 1e-6;
  // So many points may have been traced in the wrong order, within so many radii of way, if the
  // right order shortens it to this share.
  static constexpr Eigen::Index kMostReversed = 4;
  static constexpr double kReversedWay = 6.0;
  static constexpr double kWorthReversing = 0.97;
  static constexpr int kReversalPasses = 4;
  // Spurs that appear when others go are looked for this often; what then remains stays.
  static constexpr int kSpurPasses = 8;
  // Where one more binary digit would double the step of rounding: no length that people choose is
  // a power of two over this.
  static constexpr double kOffRoundLengths = 1.37;
  static constexpr int kMostBetween = 64;        // points put between two of a merged line
  static constexpr std::size_t kNeighbours = 6;  // nearest points whose edges are looked at
  static constexpr int kNamedJoins = 8;          // joined ends that are listed by name
};

// What a branch gives a spline to stand on (branch_samples.cpp).
struct SampleRules {
  static constexpr int kFewestSamples = 5;  // sparser branches get points between their points
  // Points farther apart than this, in radii, get points between them that only keep limits; so
  // many for each given point at most.
  static constexpr double kGapRadii = 1.5;
  static constexpr Eigen::Index kMostBetween = 8;
  static constexpr double kSpanRadii = 0.5;  // knots need not lie closer
  static constexpr int kMostSpans = 20000;   // of one branch
  // The radius at a junction is its parent's if it jumps by more than this (in logarithms), and by
  // more than so many times what radii vary by after it.
  static constexpr double kJump = 0.05;
  static constexpr double kJumpFactor = 3.0;
};

// How strongly a branch is smoothed (branch_smoother.cpp).
struct StrengthRules {
  static constexpr double kLeastNoise = 1e-3;  // mean radii: far below any voxel, above rounding
  // Decades by which a branch's strength differs from its tree's: noise is much the same
  // everywhere, how radii change is not.
  static constexpr double kPositionPrior = 0.5;
  static constexpr double kRadiusPrior = 1.0;
};

// What smoothing may do to radii (branch_radii.cpp).
struct RadiusRules {
  // None changes by more than this part of itself plus half its difference to its neighbours.
  static constexpr double kChange = 0.1;
  // And between two of them no curve leaves what lies between by more than this and half their
  // difference.
  static constexpr double kSwing = 0.2;
  static constexpr int kFinerSpans = 4;  // for each sample, where radii jump
  static constexpr int kTrials = 24;     // of ever weaker smoothing, each half of the last
  static constexpr double kLeastFactor =
      0.2;                               // that is left of a radius in a bend too sharp for it
  static constexpr double kReach = 2.0;  // radii to either side of such a bend
};

// How a path is brought within its largest move and bend (branch_rules.cpp).
struct EasingRules {
  static constexpr int kRounds = 30;            // of stiffening sharp bends
  static constexpr int kAlternations = 12;      // between spline and largest move, in each round
  static constexpr double kInsideLimit = 0.95;  // of the largest move: alternation leaves some over
  static constexpr double kRoomBetween = 2.0;  // factor on it for points put between the given ones
  static constexpr double kHiddenBends = 0.75;  // what a bend inside a junction counts
  static constexpr double kMoveBroken = 1e9;    // what a broken move limit counts against bends
  static constexpr double kLeastSpeed = 0.5;  // of the spline in its parameter, a length of chords
  static constexpr int kBendSamples = 8;      // of curvature, for each span
  static constexpr int kPatience = 3;         // rounds before a strength gives in to the move limit
  static constexpr double kWeaker = 0.25;     // factor by which it then gives in
  // Factors on the stiffness of a span that bends too sharply, and of the two beside it.
  static constexpr double kStiffer = 1.6;
  static constexpr double kStifferBeside = 1.25;
  static constexpr double kMostStiffness = 1e4;
  static constexpr double kLeastForce = 4.0;  // the multipliers' penalty, in weights of a sample
  static constexpr double kMostForce = 1e4;
};

// From the smoothing spline to the path that is handed on (branch_smoother.cpp).
struct PathRules {
  static constexpr int kReparametrisations = 5;  // of a spline that breaks its rules
  static constexpr double kLeastShare =
      0.1;                                  // of its old way that a sample keeps to the one before
  static constexpr int kDenseSamples = 12;  // for each span of the smoothing spline,
  static constexpr int kFewestDense = 128;  // and in all
  static constexpr int kRefinements = 12;   // halvings of the final path's spans
  // Keeps the system definite without smoothing: far below the data, at the scale of the spans.
  static constexpr double kLeastStrength = 1e-9;
};

// The tree as a whole (smooth_centerlines.cpp).
struct SmoothingRules {
  // A junction's openings lie farther out than this, in radii of its thickest branch: bends inside
  // do not reach any wall.
  static constexpr double kHidden = 1.0;
  static constexpr double kInsideLimit = 0.99;  // of the largest move, for nodes: below it in any
                                                // rounding
  static constexpr std::size_t kNamedOverlaps = 50;  // pairs that are warned of by name
  static constexpr double kWorthNaming = 0.95;  // of its radius that a branch keeps in its bends
  static constexpr double kFoldingBend = 1.0;   // curvature times radius that is warned of
};

// Which vessels overlap (overlaps.cpp).
struct OverlapRules {
  static constexpr double kCapsuleRadii = 0.5;  // length of a capsule
  static constexpr int kMostCapsules = 4096;    // of one branch: a hair is cut more coarsely
  static constexpr double kReturnRadii = 6.0;   // of way between two places that may overlap
  static constexpr double kBackRadii = 2.5;     // of way back to a junction that was left
  static constexpr double kShortBranch = 2.0;   // in radii of its junctions: these then are one
  static constexpr int kAccuracy = 2;  // capsules that a contact may be off along either branch
};

// How vessels are moved apart and thinned (keep_apart.cpp).
struct SeparationRules {
  static constexpr int kMoveRounds = 16;
  static constexpr int kThinRounds = 12;
  static constexpr double kAim = 0.02;       // radii beyond the clearance, or steps never arrive
  static constexpr double kMoveWidth = 4.0;  // radii to either side of a contact
  static constexpr double kThinWidth = 3.0;
  static constexpr double kHeldRadii = 2.0;   // of a branch at a junction that move with it, as one
  static constexpr double kHeldFirmly = 0.5;  // by a junction: then a point counts as its own
  static constexpr double kOvershoot =
      1.15;  // of a step: what is smoothed over a width falls short
  static constexpr double kInsideLimit = 0.75;  // of the largest move, for control points: between
                                                // them the path moves more
  static constexpr double kExactLimit = 0.995;  // of it, for the file's points
  static constexpr int kBackRounds = 24;    // of giving way back where one of these is too far off
  static constexpr double kGiveBack = 0.2;  // of the way, in each
  static constexpr double kGivenBack = 0.96;  // of what smoothing moved, where a vessel moves once
                                              // more
  static constexpr int kPasses = 8;  // over the balls in which a junction's points have to stay
  static constexpr double kWorthNaming = 1e-3;  // radii, or a share of them
};

}  // namespace angiospline
