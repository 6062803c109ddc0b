// Gauss-Legendre quadrature.
#pragma once

#include <Eigen/Core>

namespace angiospline {

// Nodes in (-1, 1) and weights that integrate polynomials of degree 2 count - 1 exactly.
struct GaussRule {
  Eigen::VectorXd nodes;
  Eigen::VectorXd weights;
};

// Requires count >= 1. Newton on the Legendre recurrence; full double precision.
GaussRule gauss_legendre(int count);

}  // namespace angiospline
