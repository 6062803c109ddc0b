#include "modeling/junction/patch_solver.h"

#include <algorithm>
#include <utility>

#include "base/index.h"
#include "modeling/junction/rules.h"

namespace angiospline {

using namespace junction_rules;

PatchSolver::PatchSolver(JunctionNet& net, SmoothEdges edges, const std::vector<PatchModel>& models,
                         const PatchSolverOptions& options)
    : net_(net),
      edges_(std::move(edges)),
      options_(options),
      coefficients_(best_coefficients(edges_, net)),
      system_(make_system(models)) {}

KktSystem PatchSolver::make_system(const std::vector<PatchModel>& models) {
  std::vector<KktSystem::Place> hessian;
  for (const PatchModel& model : models) {
    const std::vector<int>& unknowns = model.unknowns;
    for (std::size_t a = 0; a < unknowns.size(); ++a) {
      for (std::size_t b = 0; b <= a; ++b) {
        hessian.emplace_back(std::max(unknowns[a], unknowns[b]),
                             std::min(unknowns[a], unknowns[b]));
      }
    }
  }

  tangent_plane_jacobian(edges_, net_, coefficients_, entries_);
  std::vector<KktSystem::Place> jacobian;
  for (const JacobianEntry& e : entries_) jacobian.emplace_back(e.row, e.column);

  gradient_ = Eigen::VectorXd::Zero(size());
  return KktSystem(size(), edges_.rows, hessian, jacobian);
}

double PatchSolver::free_step(const std::vector<PatchModel>& models) {
  set_energy(models);
  system_.clear_jacobian();
  return solve_and_move(Eigen::VectorXd::Zero(edges_.rows), 1.0);
}

double PatchSolver::constrained_step(const std::vector<PatchModel>& models) {
  set_energy(models);
  set_jacobian();
  return solve_and_move(tangent_plane_residual(edges_, net_, coefficients_), kEquationShift);
}

double PatchSolver::polish_step() {
  gradient_.setZero();
  set_jacobian();
  return solve_and_move(tangent_plane_residual(edges_, net_, coefficients_), kEquationShift);
}

void PatchSolver::restart_coefficients() { coefficients_ = best_coefficients(edges_, net_); }

double PatchSolver::residual() const {
  return tangent_plane_residual(edges_, net_, coefficients_).cwiseAbs().maxCoeff();
}

void PatchSolver::set_energy(const std::vector<PatchModel>& models) {
  system_.clear();
  gradient_.setZero();

  // H and g: the sums of the patches' own, in the order in which the pattern was given.
  std::size_t place = 0;
  for (const PatchModel& model : models) {
    const Eigen::Index count = std::ssize(model.unknowns);
    for (Eigen::Index a = 0; a < count; ++a) {
      gradient_(model.unknowns[index(a)]) += model.gradient(a);
      for (Eigen::Index b = 0; b <= a; ++b) system_.add_hessian(place++, model.hessian(a, b));
    }
  }

  // A proximal term, weak against the energy, makes H positive definite where the energy is flat.
  for (std::size_t k = 0; k < net_.slots.size(); ++k) {
    const ControlSlot& slot = net_.slots[k];
    const double weight = options_.proximal / (net_.scale[k] * net_.scale[k]);
    for (int d = 0; d < slot.count; ++d) system_.add_diagonal(slot.first + d, weight);
  }
  for (int k = net_.unknowns; k < size(); ++k) system_.add_diagonal(k, kCoefficientWeight);
}

void PatchSolver::set_jacobian() {
  system_.clear_jacobian();
  tangent_plane_jacobian(edges_, net_, coefficients_, entries_);
  for (std::size_t e = 0; e < entries_.size(); ++e) system_.add_jacobian(e, entries_[e].value);
}

double PatchSolver::solve_and_move(const Eigen::VectorXd& residual, double shift) {
  // [H J'; J -eps I] [x; y] = [-g; -c]
  if (!system_.factor(shift)) return -1;
  Eigen::VectorXd right(size() + edges_.rows);
  right << -gradient_, -residual;
  const Eigen::VectorXd x = system_.solve(right);
  if (!x.allFinite()) return -1;

  // The equations are bilinear in points and coefficients: a long step leaves the range in which
  // their linearisation holds, so all of it is shortened alike.
  double longest = 0;
  for (std::size_t k = 0; k < net_.slots.size(); ++k) {
    const ControlSlot& slot = net_.slots[k];
    if (slot.count == 0) continue;
    longest = std::max(longest, x.segment(slot.first, slot.count).norm() / net_.scale[k]);
  }
  const double part = std::min(1.0, options_.longest_step / std::max(longest, 1e-300));

  net_.apply(part * x.head(net_.unknowns));
  coefficients_ += part * x.segment(net_.unknowns, edges_.coefficients);
  return longest;
}

ConstrainedSolution solve_constrained(PatchSolver& solver, const JunctionNet& net,
                                      const PatchEnergy& energy, const ConstrainedSteps& steps) {
  ConstrainedSolution solution;
  const auto took = [&](double move) {
    ++solution.steps;
    solution.solved = move >= 0;
    return solution.solved;
  };

  for (int k = 0; k < steps.most; ++k) {
    const double move = solver.constrained_step(energy(net));
    if (!took(move)) return solution;
    if (move < kShortMove) break;
  }

  // Newton's method on the equations alone: once a residual near rounding no longer halves, it has
  // come to where it can.
  solution.residual = solver.residual();
  for (int k = 0; k < steps.most_polish && solution.residual > kSolved; ++k) {
    if (!took(solver.polish_step())) return solution;
    const double now = solver.residual();
    const bool stalled = now > kStalledShare * solution.residual && now < kStalledAt;
    solution.residual = now;
    if (stalled) break;
  }
  return solution;
}

}  // namespace angiospline
