// The tuned numbers of this room: what each one trades, in one place. docs/fit.md tells the story
// and gives the figures. Numbers that a user may want to change are in FitOptions and
// DisplacementOptions instead.
#pragma once

#include <array>
#include <cstddef>

#include "modeling/junction/patch_solver.h"

namespace angiospline::fit_rules {

// ---- groups of patches (patches)

// Looser than a junction's own smoothing: samples hold the net, so that steps may be longer.
inline constexpr PatchSolverOptions kPatchSteps{0.01, 0.3};
inline constexpr ConstrainedSteps kConstrainedSteps{8, 10};

struct GroupGates {
  double starts_smooth = 1e-8;     // residual of a group that is smooth to begin with
  double worst_angle_deg = 0.005;  // between normals of neighbours
  double most_turned_cos = 0.5;    // of a normal against what it was: 60 degrees
  int steps = 12;                  // of the grid on which patches are looked at
  int edge_steps = 24;             // along an edge
  double least_share = 0.125;      // of the way, at a time: less is not worth the solve
};
inline constexpr GroupGates kGroupGates;

// ---- junctions and closed surfaces (fit_junction)

// Weights of the second differences of a move: the first that passes every gate is taken.
inline constexpr std::array<double, 4> kRoughness{0.0003, 0.002, 0.03, 0.5};
inline constexpr std::array<double, 3> kClosedRoughness{0.0, 0.002, 0.03};
inline constexpr double kAnchor = 0.02;  // shape comes before the places of parameters
inline constexpr int kClosedRatioDegree = 1;
inline constexpr double kLeastJacobianRatio = 0.03;  // or half of what it was, if that is more

// ---- bodies (fit_body)

struct BodyRules {
  double ridge = 1e-7;  // of the mean diagonal: spans without nodes stay as they are
  // Of the mean diagonal, on second differences of a body's rows: the first that does not fold.
  std::array<double, 4> fairness{3e-4, 3e-3, 0.03, 0.3};
  double least_share = 0.125;   // of a body's way
  double least_jacobian = 0.3;  // relative to what it was: less counts as folded
};
inline constexpr BodyRules kBody;

// ---- the whole network (fit_model)

inline constexpr double kEvidence =
    0.25;  // of the contrast across a region's wall: less is no wall
// Half windows of the capture of a closed surface, in its radii.
inline constexpr std::array<double, 2> kCaptureWindows{0.4, 0.2};
inline constexpr int kClosedRounds = 2;
// Of the points: with fewer in the image the frames of model and image differ.
inline constexpr double kLeastCovered = 0.5;

// ---- more freedom where residuals are large (refinement, refit)

struct RefinementRules {
  double none = 0.02;             // of the mean of marks around: nothing moves
  double full = 0.2;              // of the mean of marks around: the whole move is taken
  double patch_spans = 4.0;       // a closed surface's patch is worth so many spans
  std::size_t most_patches = 24;  // of one closed surface
};
inline constexpr RefinementRules kRefinement;

struct RefitRules {
  double rim_vox = 4.0;            // of an end: what an end does to a wall is no residual
  double progress = 0.7;           // of large residuals left, for another round
  double shortest_span_vox = 1.0;  // of a body, where residuals are large
  double reach_radii = 0.5;        // around large residuals that moves die out over
  double share_reach = 4.0;        // times that: shares are none beyond
  double longest_wave_vox = 16.0;  // how far beyond those a smooth wall feels them, at most
};
inline constexpr RefitRules kRefit;

// ---- closed surfaces (closed_surface)

inline constexpr int kSphereSteps = 12;      // of samples along each side of a sphere's patch
inline constexpr double kThinnestVox = 0.5;  // the least half axis of an ellipsoid, in voxels
inline constexpr double kLongestBlob = 3.0;  // radii: the axis of a piece that is no vessel

// ---- fewer knots (reduction)

struct ReductionRules {
  int around = 8;            // places of a section, on each patch
  int steps_a_span = 16;     // of the curve through the rings' centres
  double rows_a_span = 3.0;  // rows of the body for each span of its smooth axis
  int sections_a_row = 4;    // sections for each row of the body
  double least_step = 0.7;   // of the steps between sections that has to be left: far from a fold
};
inline constexpr ReductionRules kReduction;

}  // namespace angiospline::fit_rules
