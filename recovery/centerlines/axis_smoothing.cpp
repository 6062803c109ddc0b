#include "recovery/centerlines/axis_smoothing.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/SparseCholesky>

#include "base/contract.h"

namespace angiospline {
namespace {

// Share of the bending that the mass keeps at least; rounding of the factorisation is far below.
constexpr double kLeastMass = 1e-11;

}  // namespace

Points3 smooth_on_graph(const std::vector<SmoothingChain>& chains, const SmoothingData& data) {
  const Eigen::Index n = data.measured.cols();
  EXPECTS(data.weight.size() == n && data.wavelength.size() == n);
  if (n == 0) return data.measured;
  Eigen::VectorXd length = Eigen::VectorXd::Zero(n);  // of curve that belongs to each unknown
  Eigen::VectorXd bending_diagonal = Eigen::VectorXd::Zero(n);
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(static_cast<std::size_t>(10 * n));
  for (const SmoothingChain& chain : chains) {
    const std::vector<int>& u = chain.unknowns;
    const auto step = [&](std::size_t i) {
      return (data.measured.col(u[i + 1]) - data.measured.col(u[i])).norm();
    };
    double mean = 0.0;
    for (std::size_t i = 0; i + 1 < u.size(); ++i)
      mean += step(i) / static_cast<double>(u.size() - 1);
    if (mean == 0.0) continue;
    const double least =
        0.1 * mean;  // points that coincide would make the difference quotient blow up
    for (std::size_t i = 0; i + 1 < u.size(); ++i) {
      const double h = std::max(step(i), least);
      length[u[i]] += 0.5 * h;
      length[u[i + 1]] += 0.5 * h;
    }
    for (std::size_t i = 1; i + 1 < u.size(); ++i) {
      const double a = std::max(step(i - 1), least);
      const double b = std::max(step(i), least);
      const double stiffness =
          std::pow(data.wavelength[u[i]] / (2.0 * std::numbers::pi), 4) * 0.5 * (a + b);
      // x'' by divided differences on uneven steps.
      const std::array<double, 3> c{2.0 / (a * (a + b)), -2.0 / (a * b), 2.0 / (b * (a + b))};
      for (std::size_t p = 0; p < 3; ++p) {
        bending_diagonal[u[i - 1 + p]] += stiffness * c[p] * c[p];
        for (std::size_t q = 0; q < 3; ++q)
          entries.emplace_back(u[i - 1 + p], u[i - 1 + q], stiffness * c[p] * c[q]);
      }
    }
  }
  Eigen::VectorXd mass = data.weight.cwiseProduct(length);
  for (Eigen::Index i = 0; i < n; ++i) {
    if (length[i] == 0.0) mass[i] = 1.0;  // in no chain of positive length: stays
    // Where a wave is thousands of steps long the bending would swallow the mass in rounding.
    mass[i] = std::max(mass[i], kLeastMass * bending_diagonal[i]);
    entries.emplace_back(static_cast<int>(i), static_cast<int>(i), mass[i]);
  }
  Eigen::SparseMatrix<double> matrix(n, n);
  matrix.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(matrix);
  EXPECTS(solver.info() == Eigen::Success);
  // Solved for the shift from the measured points, so that rounding is relative to the shift.
  const Eigen::MatrixX3d measured = data.measured.transpose();
  Eigen::SparseMatrix<double> bending = matrix;
  for (Eigen::Index i = 0; i < n; ++i) bending.coeffRef(i, i) -= mass[i];
  const Eigen::MatrixX3d rhs = -(bending * measured);
  const Eigen::MatrixX3d shift = solver.solve(rhs);
  return (measured + shift).transpose();
}

}  // namespace angiospline
