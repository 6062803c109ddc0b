// Singular values and eigenvalues of dense matrices. Eigen's decompositions are half a minute of
// compiling each: they are instantiated once, here, and nowhere else for matrices of any size.
#pragma once

#include <Eigen/Core>

namespace angiospline {

enum class SingularVectors {
  kThin,      // the first min(m, n) of both sides
  kThinLeft,  // the first min(m, n) of the left side; V is empty
  kFullLeft,  // all m of the left side; V is empty
};

// A = U diag(values) V', values falling and at least 0.
struct SingularDecomposition {
  Eigen::MatrixXd U;       // m x min(m, n), or m x m
  Eigen::VectorXd values;  // min(m, n) of them
  Eigen::MatrixXd V;       // n x min(m, n), or empty
};

// The singular values and the vectors asked for of an m x n matrix. Requires finite entries.
// O(m n min(m, n)). Reference: Gu & Eisenstat, A divide-and-conquer algorithm for the bidiagonal
// SVD, SIAM J. Matrix Anal. Appl. 16 (1995).
SingularDecomposition singular_values(const Eigen::MatrixXd& A, SingularVectors vectors);

// The eigenvalues of a symmetric matrix (its lower triangle is read), rising. O(n^3).
Eigen::VectorXd symmetric_eigenvalues(const Eigen::MatrixXd& A);

}  // namespace angiospline
