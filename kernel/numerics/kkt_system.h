// The sparse symmetric system of a constrained least squares step, its pattern analysed once.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include <Eigen/SparseCore>

#include "kernel/numerics/frontal_factor.h"

namespace angiospline {

// [H J'; J -eps I] [x; y] = [-g; -c] with H positive definite: quasi-definite, so LDL' exists for
// every ordering (Vanderbei 1995). The places of H's lower triangle and of J are given once.
class KktSystem {
 public:
  using Place = std::pair<int, int>;

  // `hessian_places` (row >= column) and `jacobian_places` (row of J, column) may repeat: values at
  // the same place add up.
  KktSystem(int unknowns, int equations, const std::vector<Place>& hessian_places,
            const std::vector<Place>& jacobian_places);

  void clear();
  void add_hessian(std::size_t place, double value) { values_[hessian_[place]] += value; }
  void add_diagonal(int unknown, double value) {
    values_[diagonal_[static_cast<std::size_t>(unknown)]] += value;
  }
  void add_jacobian(std::size_t place, double value) { values_[jacobian_[place]] += value; }
  void clear_jacobian();

  // Factors with this eps; false when a pivot vanished or is not finite.
  bool factor(double epsilon);

  // The solution with one step of iterative refinement; the first `unknowns` entries are x.
  Eigen::VectorXd solve(const Eigen::VectorXd& right) const;

 private:
  int unknowns_;
  int equations_;
  Eigen::SparseMatrix<double> matrix_;
  double* values_;
  std::vector<std::size_t> hessian_;
  std::vector<std::size_t> jacobian_;
  std::vector<std::size_t> diagonal_;
  std::optional<FrontalFactor> factor_;
};

}  // namespace angiospline
