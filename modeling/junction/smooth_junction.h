// A junction's control net: fitted to its layout, then tangent-plane continuous and near its
// target.
#pragma once

#include "modeling/junction/patch_solver.h"
#include "modeling/junction/tangent_plane_rows.h"
#include "modeling/junction/target_energy.h"
#include "modeling/junction/unknowns.h"
#include "modeling/layout/layout.h"
#include "modeling/layout/target.h"
#include "modeling/layout/topology.h"

namespace angiospline {

struct SmoothingWeights {
  EnergyWeights energy;
  PatchSolverOptions solver;
  int fit_steps = 2;             // to the layout
  int free_steps = 3;            // to the target, without continuity
  ConstrainedSteps constrained;  // to the target under continuity, then on continuity alone
  EdgeDegrees degrees;
};

struct SmoothedNet {
  JunctionNet net;
  double residual = 0.0;  // largest left over in the cofactor equations, in local radii
  int steps = 0;
  bool solved = true;  // false: a linear system could not be factored
};

// Minimises the target's energy under F' + rho G' = nu H' on all inner edges by sequential
// quadratic programming with Gauss-Newton Hessians (modeling/junction/patch_solver.h), then takes
// least-norm steps on the equations alone, which converge quadratically. Whether the result is a
// fair surface is for the quality gates to say.
SmoothedNet smooth_junction(const JunctionTopology& topology, const JunctionTarget& target,
                            const JunctionLayout& layout, const SmoothingWeights& weights = {});

// The same without a target: from `start`, moving as little as possible away from the surface that
// the layout was taken from.
SmoothedNet smooth_in_place(const JunctionTopology& topology, const JunctionLayout& layout,
                            JunctionNet start);

}  // namespace angiospline
