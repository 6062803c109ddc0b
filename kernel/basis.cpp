#include "kernel/basis.h"

#include "base/contract.h"

namespace angiospline {

BasisValues basis_at(const KnotVector& knots, double t, int derivatives, int span_hint) {
  EXPECTS(derivatives >= 0);
  const int p = knots.degree();
  const int span = knots.span(t, span_hint);

  // lower(d, j): the j-th function of degree d that lives on the span.
  Eigen::MatrixXd lower = Eigen::MatrixXd::Zero(p + 1, p + 1);
  lower(0, 0) = 1;
  for (int d = 1; d <= p; ++d) {
    for (int j = 0; j < d; ++j) {
      const double left = knots[span + 1 - d + j];
      const double right = knots[span + 1 + j];
      const double share = lower(d - 1, j) / (right - left);
      lower(d, j) += share * (right - t);
      lower(d, j + 1) += share * (t - left);
    }
  }

  BasisValues result{span - p, Eigen::MatrixXd::Zero(derivatives + 1, p + 1)};
  result.values.row(0) = lower.row(p);
  for (int k = 1; k <= std::min(derivatives, p); ++k) {
    // Differentiate k times: start from degree p - k and raise by difference quotients.
    Eigen::VectorXd current = lower.row(p - k).head(p - k + 1);
    for (int d = p - k + 1; d <= p; ++d) {
      Eigen::VectorXd next = Eigen::VectorXd::Zero(d + 1);
      for (int j = 0; j < d; ++j) {
        const double share = d * current(j) / (knots[span + 1 + j] - knots[span + 1 - d + j]);
        next(j) -= share;
        next(j + 1) += share;
      }
      current = next;
    }
    result.values.row(k) = current;
  }
  return result;
}

}  // namespace angiospline
