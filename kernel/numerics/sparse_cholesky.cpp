#include "kernel/numerics/sparse_cholesky.h"

#include <Eigen/SparseCholesky>

namespace angiospline {

struct SparseCholesky::Factors {
  explicit Factors(const Eigen::SparseMatrix<double>& A) : ldlt(A) {}
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> ldlt;
};

SparseCholesky::SparseCholesky(const Eigen::SparseMatrix<double>& A)
    : factors_(std::make_unique<const Factors>(A)) {}
SparseCholesky::SparseCholesky(SparseCholesky&&) noexcept = default;
SparseCholesky& SparseCholesky::operator=(SparseCholesky&&) noexcept = default;
SparseCholesky::~SparseCholesky() = default;

bool SparseCholesky::is_positive_definite() const {
  return factors_->ldlt.info() == Eigen::Success && factors_->ldlt.vectorD().minCoeff() > 0;
}

Eigen::MatrixXd SparseCholesky::solve(const Eigen::MatrixXd& b) const {
  return factors_->ldlt.solve(b);
}

}  // namespace angiospline
