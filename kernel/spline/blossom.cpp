#include "kernel/spline/blossom.h"

#include <algorithm>

#include "base/contract.h"

namespace angiospline {

void blossom_row(const KnotVector& knots, int span, const double* args, double* out) {
  const double* U = knots.knots().data() + span;
  out[0] = 1;
  for (int d = 1; d <= knots.degree(); ++d) {
    const double x = args[d - 1];
    double carried = 0;
    for (int j = 0; j < d; ++j) {
      const double left = U[1 - d + j];
      const double right = U[1 + j];
      const double share = out[j] / (right - left);
      out[j] = carried + share * (right - x);
      carried = share * (x - left);
    }
    out[d] = carried;
  }
}

int span_inside_support(const KnotVector& knots, const KnotVector& wanted, int function) {
  const double low = std::max(wanted[function], knots.first());
  const double high = std::min(wanted[function + wanted.order()], knots.last());
  EXPECTS(low < high);
  return knots.span(low);
}

}  // namespace angiospline
