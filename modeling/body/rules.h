// The rules by which bodies are fitted and swept. "Radii" are those of the body at the place the
// rule speaks of. docs/building.md, "The body", says what each step does with them.
#pragma once

#include <array>

namespace angiospline {

// The spline a path is, and the beam that brings it to its ends (path_fit.cpp).
struct PathFitRules {
  static constexpr double kSpansPerRadius = 1.5;  // of the thinnest place,
  static constexpr double kFinest = 0.33;  // which counts as no thinner than this mean radius
  // Bending stiffness, in radii cubed for each weight of a radius of target. Slack where nothing
  // asks for more; stiff near held ends, where a turn by an angle bends by about angle / radius;
  // and for radii less, so that a slope that is missing at an end dies out at once.
  static constexpr double kSlack = 1e-4;
  static constexpr double kStiff = 4.0;
  static constexpr double kSlackRadius = 1e-3;
  // Stiffening of bends: the first step from slack, and the factor by which it grows: small where a
  // move must not be overshot, large where it evens the stiffness out.
  static constexpr double kFirstStep = 0.0125;
  static constexpr double kGrowth = 2.0;
  static constexpr double kFastGrowth = 4.0;
  static constexpr int kBesideSpans = 2;     // that are stiffened, or count as moved, with a span
  static constexpr double kNearEnd = 5.0;    // radii within which a bend is the end's
  static constexpr double kLeadBend = 0.65;  // that a lead-in should keep, so that the fit to it
                                             // has room
  // Shares of the course up to which an end may be led in: where both are, and where one is.
  static constexpr double kMostOfBoth = 0.45;
  static constexpr double kMostOfOne = 0.9;
};

// What a path gives up where it cannot have all (path.cpp).
struct PathLadderRules {
  static constexpr int kRounds = 24;     // of stiffening bends that are too tight
  static constexpr int kNarrowings = 4;  // of the radius in those that stay
  // Even spans of the path to either side of a bend: control points there hold all but a sixtieth
  // of the radius in it.
  static constexpr double kNarrowedSpans = 1.6;
  static constexpr double kNarrowerBend = 0.6;  // tightest bend of PathFreedom::kNarrower
  static constexpr double kMoreMove = 1.0;      // radii that later ways may move the path
  // Cost of a way: 1 for kMostNarrowed of the radius or so many radii from the target.
  static constexpr double kLargestDeparture = 2.0;
  static constexpr double kGoodEnough = 0.5;  // no other way is looked for
  static constexpr double kThroat =
      0.4;                              // of the radius given up: the wall is likely to fold there
  static constexpr double kLost = 2.0;  // times the departure: a part of the vessel is cut off
  static constexpr double kFoldCost = 1e3;     // of either of these: worse than any departure
  static constexpr double kNearTarget = 10.0;  // radii of way within which a point finds its place
};

// The ways that are tried from an end back to its course (lead_in.cpp).
struct LeadInRules {
  static constexpr double kStepRadii = 0.5;  // between places at which the course may be joined
  static constexpr int kSteps = 20;
  static constexpr std::array<double, 3> kReaches{1.0, 1.4, 2.0};  // of the quintic's speed, chords
  static constexpr int kSamples = 32;
};

// The sweep (body.cpp).
struct SweepRules {
  static constexpr int kFewestStations = 24;
  static constexpr int kStationsPerSpan = 4;       // of the path
  static constexpr double kStationsToHalve = 8.0;  // in a span, below which it is not halved
  static constexpr int kJacobianSteps = 4;         // places in each span where folds are looked for
};

}  // namespace angiospline
