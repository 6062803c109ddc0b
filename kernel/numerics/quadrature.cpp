#include "kernel/numerics/quadrature.h"

#include <cmath>
#include <numbers>

#include "base/contract.h"

namespace angiospline {

GaussRule gauss_legendre(int count) {
  EXPECTS(count >= 1);
  GaussRule rule{Eigen::VectorXd(count), Eigen::VectorXd(count)};

  // Newton from Tricomi's approximation to the i-th root; the polynomial by its three-term
  // recurrence.
  for (int i = 0; i < count; ++i) {
    double x = -std::cos(std::numbers::pi * (i + 0.75) / (count + 0.5));
    double slope = 0;
    for (int iteration = 0; iteration < 20; ++iteration) {
      double value = 1;
      double before = 0;
      for (int k = 1; k <= count; ++k) {
        const double next = ((2 * k - 1) * x * value - (k - 1) * before) / k;
        before = value;
        value = next;
      }
      slope = count * (x * value - before) / (x * x - 1);
      const double step = value / slope;
      x -= step;
      if (std::abs(step) < 1e-16) break;
    }

    rule.nodes(i) = x;
    rule.weights(i) = 2 / ((1 - x * x) * slope * slope);
  }
  return rule;
}

PiecewiseRule gauss_legendre(const std::vector<double>& breaks, int count) {
  const GaussRule rule = gauss_legendre(count);
  PiecewiseRule result;
  for (std::size_t k = 0; k + 1 < breaks.size(); ++k) {
    const double half = (breaks[k + 1] - breaks[k]) / 2;
    const double mid = (breaks[k + 1] + breaks[k]) / 2;
    for (Eigen::Index i = 0; i < rule.nodes.size(); ++i) {
      result.nodes.push_back(mid + half * rule.nodes(i));
      result.weights.push_back(half * rule.weights(i));
    }
  }
  return result;
}

}  // namespace angiospline
