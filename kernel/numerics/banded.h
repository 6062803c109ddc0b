// Banded linear systems as splines make them: symmetric positive definite, and totally positive.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "kernel/numerics/compact_rows.h"

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

  // Factors the matrix plus `ridge` on its diagonal, in place. A pivot that rounding took below the
  // ridge is raised to it, so that what the matrix leaves undetermined stays small. Requires a
  // positive semidefinite matrix and ridge >= 0; with none, solutions of a singular matrix are not
  // finite.
  void factor_with_ridge(double ridge);

  // Overwrites the columns of `x` (right-hand sides) by the solution. Requires a factor.
  void solve(Eigen::Ref<Eigen::MatrixXd> x) const;

  // The same for right-hand sides held as size() consecutive blocks of `stride` doubles.
  void solve_blocks(double* x, int stride) const;

 private:
  // Makes row i the factor's, but for the diagonal: returns the square of what belongs there.
  double eliminate(int i);

  int size_;
  int width_;
  std::vector<double> band_;  // row i: (i, i), (i, i - 1), ...
};

// The lower band of a symmetric matrix of half bandwidth p as a plain array, which can be added and
// scaled: p + 1 rows, one column for each column of the matrix; row k of column j is entry
// (j + k, j).
using SymmetricBand = Eigen::MatrixXd;

// Replaces A by its Cholesky factor L (A = L L'). False if A is not positive definite: here a pivot
// counts as long as it is above zero, rounding or not. O(n p^2).
bool factorise_band(SymmetricBand& A);

// Solves L L' X = B in place of B, one right-hand side for each column. O(n p) for each.
void solve_band(const SymmetricBand& L, Eigen::MatrixXd& B);

// A symmetric matrix whose band runs on round the corners, as closed splines make it: entry (i, j)
// exists where i and j are less than `width` apart on the circle of `size` rows. Its Cholesky
// factor by blocks: all rows but the last few are banded, those few are a dense border. Linear in
// size * width^2.
class CyclicCholesky {
 public:
  CyclicCholesky(int size, int width);  // all zero

  // Adds to the entries (i, j) and (j, i), which are one.
  void add(int i, int j, double value);

  // Factors in place. Whether the matrix is positive definite.
  bool factor();

  // Overwrites right-hand sides, `size` consecutive blocks of `stride` doubles. Requires factor().
  void solve_blocks(double* x, int stride) const;

 private:
  int main_;    // rows before the border
  int border_;  // rows of it: all where the circle is short
  BandedCholesky band_;
  Eigen::MatrixXd corner_;    // border_ x border_, the lower triangle
  Eigen::MatrixXd coupling_;  // border_ x main_
  Eigen::MatrixXd solved_;    // main_ x border_: the inverse of the band times coupling_'
};

// Solves A x = b for a square collocation matrix (totally positive: no pivoting is needed).
// Returns the first row without a usable pivot, or -1; b is overwritten by x.
// Reference: de Boor & Pinkus, Backward error analysis for totally positive linear systems,
// Numer. Math. 27 (1977).
int solve_totally_positive(const CompactRows& A, Eigen::Ref<Eigen::MatrixXd> b);

}  // namespace angiospline
