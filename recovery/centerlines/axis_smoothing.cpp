#include "recovery/centerlines/axis_smoothing.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/SparseCholesky>

#include "base/contract.h"
#include "base/index.h"
#include "recovery/centerlines/rules.h"

namespace angiospline {
namespace {

using namespace centerline_rules;
using Entries = std::vector<Eigen::Triplet<double>>;

// The bending energy x' K x, and the length of curve that belongs to each unknown.
struct Bending {
  Entries entries;  // of K, to be added up
  Eigen::VectorXd diagonal;
  Eigen::VectorXd length;
};

void add_chain(const std::vector<int>& u, const SmoothingData& data, Bending& bending) {
  const auto step = [&](std::size_t i) {
    return (data.measured.col(u[i + 1]) - data.measured.col(u[i])).norm();
  };
  double mean = 0.0;
  for (std::size_t i = 0; i + 1 < u.size(); ++i) {
    mean += step(i) / static_cast<double>(u.size() - 1);
  }
  if (mean == 0.0) return;

  // Each unknown stands for half of the steps beside it.
  const double least = kLeastStep * mean;
  for (std::size_t i = 0; i + 1 < u.size(); ++i) {
    const double h = std::max(step(i), least);
    bending.length[u[i]] += 0.5 * h;
    bending.length[u[i + 1]] += 0.5 * h;
  }

  // (wavelength / 2 pi)^4 |x''|^2, x'' by divided differences on uneven steps.
  for (std::size_t i = 1; i + 1 < u.size(); ++i) {
    const double a = std::max(step(i - 1), least);
    const double b = std::max(step(i), least);
    const double stiffness =
        std::pow(data.wavelength[u[i]] / (2.0 * std::numbers::pi), 4) * 0.5 * (a + b);
    const std::array<double, 3> c{2.0 / (a * (a + b)), -2.0 / (a * b), 2.0 / (b * (a + b))};
    for (std::size_t p = 0; p < 3; ++p) {
      bending.diagonal[u[i - 1 + p]] += stiffness * c[p] * c[p];
      for (std::size_t q = 0; q < 3; ++q) {
        bending.entries.emplace_back(u[i - 1 + p], u[i - 1 + q], stiffness * c[p] * c[q]);
      }
    }
  }
}

Bending bending_matrix(const std::vector<SmoothingChain>& chains, const SmoothingData& data) {
  const Eigen::Index n = data.measured.cols();
  Bending bending{{}, Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(n)};
  bending.entries.reserve(index(10 * n));
  for (const SmoothingChain& chain : chains) add_chain(chain.unknowns, data, bending);
  return bending;
}

// The diagonal of M: weight times length.
Eigen::VectorXd mass_matrix(const SmoothingData& data, const Bending& bending) {
  Eigen::VectorXd mass = data.weight.cwiseProduct(bending.length);
  for (Eigen::Index i = 0; i < mass.size(); ++i) {
    if (bending.length[i] == 0.0) mass[i] = 1.0;  // in no chain of positive length: stays
    // Where a wave is thousands of steps long the bending would swallow the mass in rounding.
    mass[i] = std::max(mass[i], kLeastMass * bending.diagonal[i]);
  }
  return mass;
}

}  // namespace

Points3 smooth_on_graph(const std::vector<SmoothingChain>& chains, const SmoothingData& data) {
  const Eigen::Index n = data.measured.cols();
  EXPECTS(data.weight.size() == n && data.wavelength.size() == n);
  if (n == 0) return data.measured;

  // (M + K) X = M X0: a smoothing spline (Reinsch: Smoothing by spline functions, Numerische
  // Mathematik 10, 1967) on a graph.
  Bending bending = bending_matrix(chains, data);
  const Eigen::VectorXd mass = mass_matrix(data, bending);
  for (Eigen::Index i = 0; i < n; ++i) {
    bending.entries.emplace_back(static_cast<int>(i), static_cast<int>(i), mass[i]);
  }
  Eigen::SparseMatrix<double> A(n, n);
  A.setFromTriplets(bending.entries.begin(), bending.entries.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(A);
  EXPECTS(solver.info() == Eigen::Success);

  // Solved for the shift from the measured points, (M + K) (X - X0) = -K X0, so that rounding is
  // relative to the shift.
  const Eigen::MatrixX3d X0 = data.measured.transpose();
  Eigen::SparseMatrix<double> K = A;
  for (Eigen::Index i = 0; i < n; ++i) K.coeffRef(i, i) -= mass[i];
  const Eigen::MatrixX3d rhs = -(K * X0);
  const Eigen::MatrixX3d shift = solver.solve(rhs);
  return (X0 + shift).transpose();
}

}  // namespace angiospline
