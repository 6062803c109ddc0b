// Banded linear systems as splines make them: symmetric positive definite, and totally positive.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "kernel/compact_rows.h"

namespace angiospline {

// A symmetric matrix by its lower band, and its Cholesky factor. Linear in rows * width^2.
class BandedCholesky {
 public:
  // All zero; entry (i, j) exists for 0 <= i - j < width.
  BandedCholesky(int size, int width);

  // The Gram matrix A' W A of compact rows, W = diag(weights); empty weights are all 1.
  static BandedCholesky gram(const CompactRows& A, const Eigen::VectorXd& weights = {});

  int size() const { return size_; }
  double& at(int i, int j) { return band_[static_cast<std::size_t>(i * width_ + (i - j))]; }

  // Factors in place. Returns the first row whose pivot is not positive (beyond rounding of its
  // diagonal entry), or -1 when the matrix is positive definite.
  int factor();

  // Overwrites the columns of `x` (right-hand sides) by the solution. Requires factor() == -1.
  void solve(Eigen::Ref<Eigen::MatrixXd> x) const;

  // The same for right-hand sides held as size() consecutive blocks of `stride` doubles.
  void solve_blocks(double* x, int stride) const;

 private:
  int size_;
  int width_;
  std::vector<double> band_;  // row i: (i, i), (i, i - 1), ...
};

// Solves A x = b for a square collocation matrix (totally positive: no pivoting is needed).
// Returns the first row without a usable pivot, or -1; b is overwritten by x.
// Reference: de Boor & Pinkus, Backward error analysis for totally positive linear systems,
// Numer. Math. 27 (1977).
int solve_totally_positive(const CompactRows& A, Eigen::Ref<Eigen::MatrixXd> b);

}  // namespace angiospline
