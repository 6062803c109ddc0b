// Gauss-Legendre quadrature.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace angiospline {

// Nodes in (-1, 1) and weights that integrate polynomials of degree 2 count - 1 exactly.
struct GaussRule {
  Eigen::VectorXd nodes;
  Eigen::VectorXd weights;
};

// Requires count >= 1. Newton on the Legendre recurrence; full double precision.
GaussRule gauss_legendre(int count);

// The rule of `count` points on each piece between consecutive breaks: exact for splines with these
// knots. Requires count >= 1.
struct PiecewiseRule {
  std::vector<double> nodes;
  std::vector<double> weights;
};
PiecewiseRule gauss_legendre(const std::vector<double>& breaks, int count);

}  // namespace angiospline
