// The tuned numbers of this room: what each one trades, in one place.
#pragma once

#include <cstdint>

namespace angiospline::thesis_smoothing_rules {

// ---- systems of triple curves (triple_smoothing)

// Gradients of constraints whose singular values lie below this share of the largest depend on the
// others.
inline constexpr double kDependent = 1e-7;
// Independent constraints are chosen anew so often: they hold near where they were chosen.
inline constexpr int kMostRestarts = 6;
// A round must leave at most this share of the angle; one that improves it less is taken back.
inline constexpr double kWorthwhile = 0.7;
inline constexpr int kAngleSamples = 32;  // along a join
// What no unknown can change has no gradient at some places in general position: how many, how far
// apart in units of the system's size, and what counts as none, as a share of the largest.
inline constexpr int kPlaces = 4;
inline constexpr double kApart = 0.1;
inline constexpr double kUnchanging = 1e-10;
// Of the optimiser (SLSQP): constraints and relative steps that count as solved and as still.
inline constexpr double kConstraintTolerance = 1e-14;
inline constexpr double kStepTolerance = 1e-10;

// ---- the thesis's bifurcation (thesis_smoothing, 7.2.4)

inline constexpr double kBodyLength = 3.0;  // radii
// Standard deviation of the moves that stand in for a fit, in radii, and the seed they come from.
inline constexpr double kFitMove = 0.01;
inline constexpr std::uint64_t kFitSeed = 7;
inline constexpr double kSamePlace = 1e-9;  // radii: points of two neighbours' cuts that are one
inline constexpr int kPatchRows = 6;        // and columns: bi-quintic patches without inner knots

}  // namespace angiospline::thesis_smoothing_rules
