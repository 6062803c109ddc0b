// Tangent-plane continuity as the thesis enforces it (3.2): triple-curve constraints at the nodes,
// "move as little as possible", sequential quadratic programming. For networks of any patches;
// smooth_junction.h has the form that scales.
#pragma once

#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "modeling/network/surface_network.h"

namespace angiospline {

struct TripleSmoothingOptions {
  bool floating = true;        // boundary curves may move; otherwise only the rows beside them
  double wanted_deg = 0.01;    // stop once no boundary is rougher
  int most_evaluations = 400;  // of all constraints with their gradients
  double most_seconds = 60.0;
};

enum class TripleEnding {
  kSmooth,      // every boundary of the system is within wanted_deg
  kStalled,     // no further step helped: roundoff, or there is no such surface nearby
  kOutOfTime,   // most_evaluations or most_seconds
  kInfeasible,  // nothing can move: no unknowns
};

// One system of boundaries solved together.
struct TripleSystemReport {
  int boundaries = 0;
  int constraints = 0;  // nodes of all triple curves
  int independent = 0;  // rank of their gradients at the start: what the solver is given
  int unknowns = 0;     // coordinates of control points that may move
  int distances = 0;    // those control points: the terms of "move as little as possible"
  // What no unknown can change, wherever it moves (measured where boundaries are held, or where no
  // solution was found): combinations of the constraints, and how far from zero they are. Phi is
  // divided by mean lengths of its factors, so this is about a sine. Above zero: no solution
  // exists.
  int fixed = 0;
  double fixed_residual = 0.0;   // norm of their values: a lower bound for the norm of all of Phi
  double fixed_angle_deg = 0.0;  // largest angle at a boundary's end that no unknown can change
  int evaluations = 0;
  double seconds = 0.0;
  double before_deg = 0.0;  // largest angle between normals over the system's boundaries
  double after_deg = 0.0;
  double moved_mm = 0.0;  // the farthest way of a control point
  TripleEnding ending = TripleEnding::kStalled;
};

// For each system (a list of SurfaceNetwork::joins) asks Phi = 0 at the nodes of every boundary of
// it. Unknowns: control points on the boundaries (floating) and in the rows beside them, without
// those that lie on other boundaries or rims or depend on others: these are held. Systems must
// share no unknowns; they are solved in parallel, each by NLopt's SLSQP with exact gradients on an
// independent set of combinations of its constraints (redundant ones, which meet at corners, make
// the quadratic programs singular), chosen anew when a run ends. Joins must be whole sides.
// Errors: a join out of range or of parts of sides; two systems that share a control point;
// stopped.
Result<std::vector<TripleSystemReport>> smooth_by_triple_curves(
    SurfaceNetwork& network, const std::vector<std::vector<int>>& systems,
    const TripleSmoothingOptions& options = {}, const Progress& progress = {});

// The largest angle between normals along one join, at 33 points with both ends.
double join_angle_deg(const SurfaceNetwork& network, int join);

}  // namespace angiospline
