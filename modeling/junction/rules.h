// The tuned numbers of this room: what each one trades, in one place. Lengths are in the junction's
// unit, its largest radius, unless a comment says otherwise. docs/junctions.md tells the story.
#pragma once

#include <array>
#include <cstddef>
#include <numbers>

namespace angiospline::junction_rules {

// ---- which settings are tried (make_junction)

// One set of choices; blend and rounding are relative to those of the plan, the
// anchor to the usual one.
struct LadderSetting {
  double blend = 1.0;
  double rounding = 1.0;
  double area_weight = 0.5;
  double merge_deg = 5.0;
  double follow = 0.5;
  int sweeps = 60;
  double anchor = 1.0;
};

// One after the other; the gentlest fair surface wins, otherwise the best sound one
// (docs/junctions.md).
inline constexpr std::array<LadderSetting, 16> kLadder{{{1.0, 1.0, 0.5, 5.0, 0.5, 60, 1},
                                                        {1.0, 1.0, 0.5, 5.0, 0.5, 60, 10},
                                                        {1.5, 1.3, 0.5, 5.0, 0.5, 60, 0.1},
                                                        {2.0, 1.6, 0.5, 5.0, 0.5, 60, 3},
                                                        {3.0, 2.0, 0.5, 5.0, 0.5, 60, 1},
                                                        {1.5, 1.3, 0.5, 5.0, 0.0, 8, 1},
                                                        {1.0, 1.0, 1.5, 5.0, 0.5, 60, 1},
                                                        {1.0, 1.0, 0.5, 10.0, 0.5, 60, 3},
                                                        {1.0, 1.0, 0.5, 5.0, 0.0, 8, 3},
                                                        {1.5, 1.5, 0.2, 10.0, 0.0, 60, 1},
                                                        {0.7, 1.0, 1.0, 2.0, 0.5, 30, 3},
                                                        {1.0, 1.5, 0.1, 5.0, 0.5, 60, 1},
                                                        {2.0, 2.0, 0.5, 5.0, 0.0, 20, 10},
                                                        {1.5, 1.3, 1.5, 15.0, 0.5, 60, 1},
                                                        {1.2, 1.2, 0.5, 15.0, 0.0, 30, 3},
                                                        {0.8, 1.2, 1.5, 5.0, 0.0, 120, 1}}};

// Curvature times smallest radius that is gentle enough; where many branches meet a try takes long.
inline constexpr double kGentle = 8;
inline constexpr double kGentleOfMany = 10;
inline constexpr int kMoreTries = 4;  // for a fair surface that is sharper than its target
// From so many branches on a setting takes half a second and more, mostly after all other junctions
// of the tree: then two are tried at a time, and few more once one is fair.
inline constexpr std::size_t kMany = 6;
inline constexpr int kMoreTriesOfMany = 1;
inline constexpr std::size_t kAtATime = 2;

// ---- where branches leave (plan_openings)

inline constexpr double kLargestShare = 0.05;  // of the other branches at an opening's circle
inline constexpr double kLeastMargin = 0.3;    // radii
inline constexpr double kLeastAngleRad = 1.0 * std::numbers::pi / 180;  // between two branches
inline constexpr double kUnitTolerance = 1e-6;                          // of a direction's length
inline constexpr int kCirclePoints = 24;     // of an opening, where shares are looked at
inline constexpr int kOpeningHalvings = 18;  // of the way between too near and far enough
// Largest radii at which directions of offset branches are compared.
inline constexpr double kDirectionReach = 4;
// Of the blend asked for, one after the other, where a branch is too short for all of it.
inline constexpr std::array<double, 4> kBlendParts{1.0, 0.75, 0.5, 1.0 / 3};

// ---- the solver (patch_solver)

// -eps in the corner of the KKT matrix: makes it quasi-definite, so that every order of
// elimination works, and stays far below what the equations are solved to.
inline constexpr double kEquationShift = 1e-12;
// On squared steps of rho's and nu's coefficients: keeps those determined that no equation needs.
inline constexpr double kCoefficientWeight = 1e-3;
inline constexpr double kShortMove = 1e-3;   // in local radii: a step that needs no successor
inline constexpr double kSolved = 1e-13;     // largest residual that counts as zero, in local radii
inline constexpr double kStalledAt = 1e-10;  // a residual below it that does not halve is rounding
inline constexpr double kStalledShare = 0.5;

// ---- the energy (target_energy)

// A tangent counts as no shorter than this, in local radii: sines are weighed by the inverse of its
// length.
inline constexpr double kShortestTangent = 0.05;

// ---- the start of a net (unknowns)

inline constexpr double kLeastDepth = 0.1;  // radii that the second row starts below an opening

// ---- gates (quality)

struct QualityGates {
  // Sound: what may be used at all.
  double worst_angle_deg = 1e-3;       // between normals of neighbours
  double least_jacobian_ratio = 0.03;  // |Su x Sv| over its mean: below, a patch is nearly folded
  double most_off_target_deg = 60;  // between a normal and the target's: beyond, a patch is turned
  // Fair: what looks like a vessel too. Lengths over the smallest radius.
  double fair_curvature = 20;
  double fair_distance = 0.5;  // from the cylinders
  // Good: a further try could hardly be better.
  double good_angle_deg = 1e-6;
  double good_curvature = 8;  // gentle enough whatever the target
  double good_off_target = 0.15;
  double sharper_than_target = 1.2;  // a surface may be by this factor
};
inline constexpr QualityGates kGates;
inline constexpr int kQualityGrid = 13;         // places along each side of a patch
inline constexpr int kQualityEdgeSamples = 33;  // along an edge: two to a step of the grid and more
inline constexpr double kNormalStep = 1e-4;     // of differences of normals, in smallest radii
inline constexpr double kNotANumber = 1e300;    // stands for NaN, so that it fails every gate

}  // namespace angiospline::junction_rules
