// L D L' of a sparse symmetric matrix, by Eigen's simplicial factorisation, compiled once.
#pragma once

#include <memory>

#include <Eigen/SparseCore>

namespace angiospline {

// A factor for few right sides of one matrix. Where the same pattern is factored again and again
// FrontalFactor is faster.
class SparseCholesky {
 public:
  // Factors A, which is symmetric; its lower triangle is read.
  explicit SparseCholesky(const Eigen::SparseMatrix<double>& A);
  SparseCholesky(SparseCholesky&&) noexcept;
  SparseCholesky& operator=(SparseCholesky&&) noexcept;
  ~SparseCholesky();

  // Whether no pivot vanished and all are positive.
  bool is_positive_definite() const;

  // The solutions of A x = b, a column for each right side. Requires that no pivot vanished.
  Eigen::MatrixXd solve(const Eigen::MatrixXd& b) const;

 private:
  struct Factors;
  std::unique_ptr<const Factors> factors_;
};

}  // namespace angiospline
