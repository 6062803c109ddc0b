// Internal forces of a finite-element mesh, and ways to divide by its damping (thesis 5.1 to 5.5).
#pragma once

#include <memory>

#include <Eigen/SparseCore>

#include "base/result.h"
#include "recovery/thesis/deform/mesh.h"

namespace angiospline {

// Coefficients of every element; the thesis normalises its own to 1. Lengths are voxels.
struct ElementOptions {
  double spring = 1.0;    // pulls along the axis between two neighbours, by its change of length
  double membrane = 0.0;  // pulls two neighbours' displacements together
  double bending = 0.0;   // pulls a displacement to the mean of its neighbours' (thin plate)
  double damping = 1.0;   // between neighbours' velocities, in all directions alike
  double drag = 0.0;      // of each node against the ground
  double mass = 1.0;      // of each node

  // Error: a coefficient negative or not finite (named).
  Result<void> check() const;
};

// constant I + linear L + square L^2 of the graph Laplacian L, each at least 0.
struct LaplacianPolynomial {
  double constant = 0.0;
  double linear = 0.0;
  double square = 0.0;
};
// membrane L + bending L^2, and the springs as if they were membranes.
LaplacianPolynomial stiffness(const ElementOptions& e);
// C + dt (K + steepness I): what a massless implicit step of dt divides by, where the potentials
// change by `steepness` with a node's place.
LaplacianPolynomial implicit_step(const ElementOptions& e, double dt, double steepness);

enum class SystemForm {
  kElements,   // element by element (5.18): nothing is assembled
  kAssembled,  // sparse global matrices (5.2), the springs' anew in every step
};

// The forces inside a mesh whose rest shape is where it starts.
class ElementSystem {
 public:
  ElementSystem(const DeformMesh& mesh, double voxel_mm, const ElementOptions& options);

  const Points3& rest() const { return rest_; }  // in voxels

  // Force of the elements on each node at these positions. Both forms agree to rounding. O(nodes).
  Points3 internal(const Points3& nodes, SystemForm form) const;
  // Damping force at these velocities: -C v. O(nodes).
  Points3 damping(const Points3& velocity, SystemForm form) const;

  // The graph Laplacian: number of neighbours on the diagonal, -1 for each neighbour. The damping
  // matrix of every coordinate is damping * L + drag * I, (5.24).
  const Eigen::SparseMatrix<double>& laplacian() const { return laplacian_; }
  Eigen::SparseMatrix<double> matrix(const LaplacianPolynomial& p) const;
  // Largest over least eigenvalue of matrix(p) at most; infinite where p.constant is 0.
  double condition(const LaplacianPolynomial& p) const;

 private:
  Points3 sum_over_springs(const Points3& field) const;  // -L field, element by element

  Eigen::Matrix2Xi springs_;
  ElementOptions options_;
  Points3 rest_;
  Eigen::VectorXd rest_length_;
  Eigen::SparseMatrix<double> laplacian_;
};

// Solves A x = b for one right side a coordinate: rows of the 3 x n argument.
class Division {
 public:
  virtual ~Division() = default;
  virtual Points3 operator()(const Points3& b) const = 0;
};

// The pseudo-inverse by singular values; those below 1e-10 of the largest count as 0. The system is
// the same for each coordinate, so one of n x n does for the thesis's 3n x 3n. O(n^3), then O(n^2).
std::unique_ptr<Division> divide_by_svd(const Eigen::SparseMatrix<double>& A);

// Circulant matrices by discrete Fourier transforms, any length (5.30): eigenvalues below 1e-10 of
// the largest make 0. `centre` on the diagonal for a node with four neighbours (two on a contour),
// `side` for each neighbour.
//   kPlain: the rows of nodes one after another, a node's neighbours +-1 and +-columns away: where
//     rows meet, and at the two ends, neighbours are wrong (thesis 5.5.2: unacceptable there).
//   kPhantom: a node more at both ends of each row, that repeats the other end's, and a row of
//     zeros at both ends of the tube. A contour needs none and gets none.
// O(n log n) where n has small factors.
enum class CirculantNodes { kPlain, kPhantom };
std::unique_ptr<Division> divide_by_circulant(const PeriodicGrid& grid, double centre, double side,
                                              CirculantNodes nodes);

// A sparse factorisation L D L^T, made once. Error: A is not positive definite.
Result<std::unique_ptr<Division>> divide_by_sparse(const Eigen::SparseMatrix<double>& A);

// Conjugate gradients with the diagonal as preconditioner, until |b - A x| <= error |b| for each
// coordinate. Nothing is factorised: O(nonzeros sqrt(condition) log(1 / error)). Requires a
// positive definite A.
std::unique_ptr<Division> divide_by_gradients(Eigen::SparseMatrix<double> A, double error);

}  // namespace angiospline
