#include "modeling/junction/smooth_junction.h"

#include <utility>

namespace angiospline {
namespace {

// Weights for fitting the layout itself.
constexpr EnergyWeights kFitWeights{0.0, 0.1, 1.0, 0.001, 1.0};
// Without a target: near the net that is there, as even as it is.
constexpr EnergyWeights kInPlaceWeights{0.0, 0.0, 1.0, 1e-5, 1.0};

// From result.net.
void smooth(const JunctionTopology& topology, const JunctionTarget* target,
            const JunctionLayout& layout, const SmoothingWeights& weights, SmoothedNet& result) {
  TargetEnergy energy(topology, target, layout, result.net);
  PatchSolver solver(result.net, smooth_edges(topology, layout, result.net, weights.degrees),
                     energy.models(), weights.solver);

  // The equations have many solutions far from any vessel: the net first comes near its layout and
  // its target without them.
  const auto free_steps = [&](int count, const EnergyWeights& with) {
    for (int k = 0; k < count && result.solved; ++k) {
      ++result.steps;
      result.solved = solver.free_step(energy.updated(result.net, with)) >= 0;
    }
  };
  free_steps(weights.fit_steps, kFitWeights);
  free_steps(weights.free_steps, weights.energy);
  if (!result.solved) return;
  solver.restart_coefficients();

  const auto at_net = [&](const JunctionNet& net) -> const std::vector<PatchModel>& {
    return energy.updated(net, weights.energy);
  };
  const ConstrainedSolution solution =
      solve_constrained(solver, result.net, at_net, weights.constrained);
  result.residual = solution.residual;
  result.steps += solution.steps;
  result.solved = solution.solved;
}

}  // namespace

SmoothedNet smooth_junction(const JunctionTopology& topology, const JunctionTarget& target,
                            const JunctionLayout& layout, const SmoothingWeights& weights) {
  SmoothedNet result{start_net(topology, layout), 0.0, 0, true};
  smooth(topology, &target, layout, weights, result);
  return result;
}

SmoothedNet smooth_in_place(const JunctionTopology& topology, const JunctionLayout& layout,
                            JunctionNet start) {
  SmoothingWeights weights;
  weights.energy = kInPlaceWeights;
  weights.fit_steps = weights.free_steps = 0;
  SmoothedNet result{std::move(start), 0.0, 0, true};
  smooth(topology, nullptr, layout, weights, result);
  return result;
}

}  // namespace angiospline
