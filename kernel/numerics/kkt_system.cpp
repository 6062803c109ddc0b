#include "kernel/numerics/kkt_system.h"

#include <algorithm>

namespace angiospline {

KktSystem::KktSystem(int unknowns, int equations, const std::vector<Place>& hessian_places,
                     const std::vector<Place>& jacobian_places)
    : unknowns_(unknowns),
      equations_(equations),
      matrix_(unknowns + equations, unknowns + equations) {
  // The pattern: H, J below it, and the whole diagonal.
  std::vector<Eigen::Triplet<double>> triplets;
  triplets.reserve(hessian_places.size() + jacobian_places.size() +
                   static_cast<std::size_t>(unknowns + equations));
  for (const auto& [row, column] : hessian_places) triplets.emplace_back(row, column, 1.0);
  for (const auto& [row, column] : jacobian_places) {
    triplets.emplace_back(unknowns + row, column, 1.0);
  }
  for (int k = 0; k < unknowns + equations; ++k) triplets.emplace_back(k, k, 1.0);
  matrix_.setFromTriplets(triplets.begin(), triplets.end());
  matrix_.makeCompressed();
  values_ = matrix_.valuePtr();

  // Where each value goes is looked up once.
  const auto find = [&](int row, int column) {
    const int* begin = matrix_.innerIndexPtr() + matrix_.outerIndexPtr()[column];
    const int* end = matrix_.innerIndexPtr() + matrix_.outerIndexPtr()[column + 1];
    return static_cast<std::size_t>(std::lower_bound(begin, end, row) - matrix_.innerIndexPtr());
  };
  hessian_.reserve(hessian_places.size());
  for (const auto& [row, column] : hessian_places) hessian_.push_back(find(row, column));
  for (const auto& [row, column] : jacobian_places) {
    jacobian_.push_back(find(unknowns + row, column));
  }
  for (int k = 0; k < unknowns + equations; ++k) diagonal_.push_back(find(k, k));
  factor_.emplace(matrix_);
}

void KktSystem::clear() { std::fill(values_, values_ + matrix_.nonZeros(), 0.0); }

void KktSystem::clear_jacobian() {
  for (const std::size_t place : jacobian_) values_[place] = 0;
}

bool KktSystem::factor(double epsilon) {
  for (int k = 0; k < equations_; ++k) {
    values_[diagonal_[static_cast<std::size_t>(unknowns_ + k)]] = -epsilon;
  }
  return factor_->factor(matrix_);
}

Eigen::VectorXd KktSystem::solve(const Eigen::VectorXd& right) const {
  Eigen::VectorXd x = factor_->solve(right);
  const Eigen::VectorXd rest = right - matrix_.selfadjointView<Eigen::Lower>() * x;
  x += factor_->solve(rest);
  return x;
}

}  // namespace angiospline
