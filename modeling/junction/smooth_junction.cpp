#include "modeling/junction/smooth_junction.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "kernel/numerics/kkt_system.h"

namespace angiospline {
namespace {

constexpr double kEquationShift = 1e-12;     // -eps in the corner of the KKT matrix
constexpr double kCoefficientWeight = 1e-3;  // keeps rho and nu determined
constexpr EnergyWeights kInPlaceWeights{0.0, 0.0, 1.0, 1e-5, 1.0};
constexpr double kSolved = 1e-13;  // largest residual that counts as zero, in radii

// One junction's sequence of steps on one sparse pattern.
class StepSolver {
 public:
  StepSolver(const JunctionTopology& topology, const JunctionTarget* target,
             const JunctionLayout& layout, const SmoothingWeights& weights, JunctionNet& net)
      : weights_(weights),
        net_(net),
        energy_(topology, target, layout, net),
        edges_(smooth_edges(topology, layout, net, weights.degrees)),
        coefficients_(best_coefficients(edges_, net)),
        system_(make_system()) {}

  // A step towards the energy's minimum; the largest move in local radii, or -1 on failure.
  double free_step(const EnergyWeights& energy) {
    set_energy(energy, weights_.proximal);
    system_.clear_jacobian();
    return solve_and_move(Eigen::VectorXd::Zero(edges_.rows), 1.0);
  }

  double constrained_step(const EnergyWeights& energy) {
    set_energy(energy, weights_.proximal);
    set_jacobian();
    return solve_and_move(tangent_plane_residual(edges_, net_, coefficients_), kEquationShift);
  }

  // The energy's Hessian of the last step serves as the norm.
  double polish_step() {
    gradient_.setZero();
    set_jacobian();
    return solve_and_move(tangent_plane_residual(edges_, net_, coefficients_), kEquationShift);
  }

  void restart_coefficients() { coefficients_ = best_coefficients(edges_, net_); }

  double residual() const {
    return tangent_plane_residual(edges_, net_, coefficients_).cwiseAbs().maxCoeff();
  }

 private:
  KktSystem make_system() {
    std::vector<KktSystem::Place> hessian;
    for (int p = 0; p < energy_.patches(); ++p) {
      const std::vector<int>& unknowns = energy_.model(p).unknowns;
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

  int size() const { return net_.unknowns + edges_.coefficients; }

  void set_energy(const EnergyWeights& energy, double proximal) {
    energy_.update(net_, energy);
    system_.clear();
    gradient_.setZero();
    std::size_t place = 0;
    for (int p = 0; p < energy_.patches(); ++p) {
      const PatchModel& model = energy_.model(p);
      const Eigen::Index count = static_cast<Eigen::Index>(model.unknowns.size());
      for (Eigen::Index a = 0; a < count; ++a) {
        gradient_(model.unknowns[static_cast<std::size_t>(a)]) += model.gradient(a);
        for (Eigen::Index b = 0; b <= a; ++b) system_.add_hessian(place++, model.hessian(a, b));
      }
    }
    for (std::size_t k = 0; k < net_.slots.size(); ++k) {
      const ControlSlot& slot = net_.slots[k];
      const double weight = proximal / (net_.scale[k] * net_.scale[k]);
      for (int d = 0; d < slot.count; ++d) system_.add_diagonal(slot.first + d, weight);
    }
    for (int k = net_.unknowns; k < size(); ++k) system_.add_diagonal(k, kCoefficientWeight);
  }

  void set_jacobian() {
    system_.clear_jacobian();
    tangent_plane_jacobian(edges_, net_, coefficients_, entries_);
    for (std::size_t e = 0; e < entries_.size(); ++e) system_.add_jacobian(e, entries_[e].value);
  }

  double solve_and_move(const Eigen::VectorXd& residual, double shift) {
    if (!system_.factor(shift)) return -1;
    Eigen::VectorXd right(size() + edges_.rows);
    right << -gradient_, -residual;
    const Eigen::VectorXd x = system_.solve(right);
    if (!x.allFinite()) return -1;
    Eigen::VectorXd move = x.head(net_.unknowns);
    double longest = 0;
    for (std::size_t k = 0; k < net_.slots.size(); ++k) {
      const ControlSlot& slot = net_.slots[k];
      if (slot.count == 0) continue;
      longest = std::max(longest, move.segment(slot.first, slot.count).norm() / net_.scale[k]);
    }
    const double part = std::min(1.0, weights_.longest_step / std::max(longest, 1e-300));
    net_.apply(part * move);
    coefficients_ += part * x.segment(net_.unknowns, edges_.coefficients);
    return longest;
  }

  const SmoothingWeights& weights_;
  JunctionNet& net_;
  TargetEnergy energy_;
  SmoothEdges edges_;
  Eigen::VectorXd coefficients_;
  std::vector<JacobianEntry> entries_;
  Eigen::VectorXd gradient_;
  KktSystem system_;
};

// From result.net.
void smooth(const JunctionTopology& topology, const JunctionTarget* target,
            const JunctionLayout& layout, const SmoothingWeights& weights, SmoothedNet& result) {
  StepSolver solver(topology, target, layout, weights, result.net);
  const auto took = [&](double move) {
    ++result.steps;
    result.solved = move >= 0;
    return result.solved;
  };
  for (int k = 0; k < weights.fit_steps; ++k) {
    if (!took(solver.free_step(kFitWeights))) return;
  }
  for (int k = 0; k < weights.free_steps; ++k) {
    if (!took(solver.free_step(weights.energy))) return;
  }
  solver.restart_coefficients();
  for (int k = 0; k < weights.most_steps; ++k) {
    const double move = solver.constrained_step(weights.energy);
    if (!took(move)) return;
    if (move < 1e-3) break;
  }
  result.residual = solver.residual();
  for (int k = 0; k < weights.most_polish_steps && result.residual > kSolved; ++k) {
    if (!took(solver.polish_step())) return;
    const double now = solver.residual();
    const bool stalled = now > 0.5 * result.residual && now < 1e-10;
    result.residual = now;
    if (stalled) break;
  }
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
