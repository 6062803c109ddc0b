// The tuned numbers of this room: what each one trades, in one place. Numbers that a user may want
// to change are in DeformOptions and DeformModelOptions instead; docs/deformation.md has figures.
#pragma once

#include <Eigen/Core>

namespace angiospline::deform_rules {

// ---- a model's deformation (deform_model), the default solver's

// Thin plates (of springs of 1) keep spurious edges from denting the wall; the membranes of the
// small meshes of DeformOptions resist a change of radius, so they are left out.
inline constexpr double kPlateBending = 10.0;
inline constexpr double kPlateMembrane = 0.0;
// Each stage starts at rest where the last one ended, so that plates resist only what the next one
// adds; the first reaches as far as the start may be off, the others only `kNearVox` voxels.
inline constexpr int kStages = 3;
inline constexpr double kNearVox = 2.0;
// What lies farther from an end's axis than this, in the end's radii, belongs to something else.
inline constexpr double kBesideRim = 2.0;
inline constexpr int kRimPoints = 16;  // of each side of a rim, for its centre and radius
// Share of a region's nodes that edges must pull; with fewer the image does not show the vessel.
inline constexpr double kLeastPulled = 0.1;

// ---- refinement (network_refinement)

inline constexpr double kAimLower = 0.9;  // of the tolerance that equal pieces have just missed
// A span is cut into at most so many times its pieces at a time: sides do not quite shrink alike.
inline constexpr double kMostFiner = 2.0;

// ---- the solver (solver, system)

// A factor fills in, and its making and its triangular solves grow faster than the mesh; conjugate
// gradients on these well-conditioned matrices take some twenty products whatever its size. The
// place of rest does not depend on their error, only the way there.
inline constexpr int kMostFactorised = 10000;  // nodes
inline constexpr double kMostCondition = 1e4;  // some 1,000 products
inline constexpr double kGradientError = 1e-8;

// Singular values and eigenvalues below this share of the largest count as zero.
inline constexpr double kSingular = 1e-10;

// The least eigenvalue of the damping is exact for up to so many nodes (O(n^3)), and beyond by
// inverse iterations on the matrix moved from singularity by a shift below their error.
inline constexpr Eigen::Index kMostDenseNodes = 1500;
inline constexpr double kEigenvalueShift = 1e-9;
inline constexpr int kInverseIterations = 60;
// Share of the largest explicit step that does not overshoot (2), and the longest one all the same.
inline constexpr double kStableStep = 1.85;
inline constexpr double kLongestStep = 0.4;

// The thesis's configuration of steps and rest (thesis_options). A massless step divides by damping
// and may be long; one with mass follows the swinging, and some drag ends it.
struct ThesisSteps {
  double time_step;
  double drag;
  int window;  // iterations over which a place is averaged
};
inline constexpr ThesisSteps kMassless{0.1, 0.0, 10};
inline constexpr ThesisSteps kWithMass{0.02, 0.2, 50};
inline constexpr double kThesisRestSpeed = 0.1;  // voxels a unit of time

// ---- potentials

// Rounding of two distances and of a path, as a share of them.
inline constexpr double kDistanceRounding = 1e-12;

}  // namespace angiospline::deform_rules
