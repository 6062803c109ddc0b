// Steps of a net of patches towards the least energy under common tangent planes.
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "kernel/numerics/kkt_system.h"
#include "modeling/junction/tangent_plane_rows.h"
#include "modeling/junction/unknowns.h"

namespace angiospline {

// A patch's share of an energy, as a quadratic function of a step x of the unknowns that the patch
// depends on: x' H x / 2 + g' x. H is symmetric, positive semidefinite; its lower triangle counts.
struct PatchModel {
  std::vector<int> unknowns;
  Eigen::MatrixXd hessian;
  Eigen::VectorXd gradient;
};

// An energy of a net: one model a patch, at the net's current points. Patches may share unknowns,
// their models add up. The same unknowns in the same order at every call; the models hold until
// the next call.
using PatchEnergy = std::function<const std::vector<PatchModel>&(const JunctionNet&)>;

struct PatchSolverOptions {
  double proximal = 0.05;  // squared step of every control point, in local radii
  double longest_step =
      0.3;  // of any control point, in local radii; longer ones are cut as a whole
};

// Sequential quadratic programming on F' + rho G' = nu H' along the edges
// (modeling/junction/tangent_plane_rows.h): each step solves the KKT system of the energy's models
// and the equations' linearisation (Nocedal & Wright: Numerical Optimization, 18.1), on one sparse
// pattern that is analysed once. Junctions are smoothed and fitted surfaces are moved by it alike;
// what differs between the two is the energy (modeling/junction/target_energy.h,
// recovery/fit/patches.h) and the gates that a result has to pass, which stay with them: they look
// at other places (13 x 13 against 33 or 25 on an edge) and form their means in another order.
//
// Steps return the largest move of a control point in local radii, before it was cut, or -1 if the
// system could not be solved; nothing moved then. The net must outlive the solver, and its slots
// stay as they are.
class PatchSolver {
 public:
  // `models` give the pattern: their unknowns count, not their values.
  PatchSolver(JunctionNet& net, SmoothEdges edges, const std::vector<PatchModel>& models,
              const PatchSolverOptions& options);

  // Towards the energy's minimum, equations left aside.
  double free_step(const std::vector<PatchModel>& models);

  // Towards the energy's minimum under the linearised equations.
  double constrained_step(const std::vector<PatchModel>& models);

  // The shortest step onto the linearised equations; the Hessian of the last step is the norm.
  double polish_step();

  // Takes rho and nu anew from the net as it is.
  void restart_coefficients();

  // Largest left over in the equations, in local radii. Requires at least one edge.
  double residual() const;

 private:
  KktSystem make_system(const std::vector<PatchModel>& models);
  int size() const { return net_.unknowns + edges_.coefficients; }
  void set_energy(const std::vector<PatchModel>& models);
  void set_jacobian();
  double solve_and_move(const Eigen::VectorXd& residual, double shift);

  JunctionNet& net_;
  SmoothEdges edges_;
  PatchSolverOptions options_;
  Eigen::VectorXd coefficients_;
  std::vector<JacobianEntry> entries_;
  Eigen::VectorXd gradient_;
  KktSystem system_;
};

struct ConstrainedSteps {
  int most = 12;         // with the energy; fewer where they have become short
  int most_polish = 10;  // on the equations alone; fewer once those hold
};

struct ConstrainedSolution {
  double residual = 0.0;  // largest left over in the equations, in local radii
  int steps = 0;
  bool solved = true;  // false: a linear system could not be factored
};

// Steps under the equations until the net hardly moves, then steps on the equations alone, which
// converge quadratically, until they hold to rounding or no longer come nearer.
ConstrainedSolution solve_constrained(PatchSolver& solver, const JunctionNet& net,
                                      const PatchEnergy& energy, const ConstrainedSteps& steps);

}  // namespace angiospline
