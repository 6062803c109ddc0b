#include "kernel/spline/basis.h"

#include <algorithm>
#include <array>

#include "base/contract.h"

namespace angiospline {
namespace {

// Raises the functions of degree d - 1 on a span to degree d, in place: `row` holds d values and
// gets d + 1; U points at knot(span).
inline void raise_degree(const double* U, double t, int d, double* row) {
  double carried = 0;
  for (int j = 0; j < d; ++j) {
    const double left = U[1 - d + j];
    const double right = U[1 + j];
    const double share = row[j] / (right - left);
    row[j] = carried + share * (right - t);
    carried = share * (t - left);
  }
  row[d] = carried;
}

// The derivatives of degree-d functions from values of degree d - 1 (difference quotients).
inline void raise_derivative(const double* U, int d, double* row) {
  double carried = 0;
  for (int j = 0; j < d; ++j) {
    const double share = d * row[j] / (U[1 + j] - U[1 - d + j]);
    row[j] = carried - share;
    carried = share;
  }
  row[d] = carried;
}

// kFixed > 0 is the degree known at compile time, so that every loop unrolls.
template <int kFixed>
void fill(const double* U, int degree, double t, int derivatives, double* out) {
  const int p = kFixed > 0 ? kFixed : degree;
  const int order = p + 1;
  // Row k waits at degree p - k until the value row has passed it, then is differentiated k times.
  out[0] = 1;
  for (int d = 1; d <= p; ++d) {
    const int k = p - d + 1;  // the value row is now at degree d - 1 = p - k
    if (k <= derivatives) std::copy(out, out + d, out + k * order);
    raise_degree(U, t, d, out);
  }
  for (int k = 1; k <= std::min(derivatives, p); ++k) {
    for (int d = p - k + 1; d <= p; ++d) raise_derivative(U, d, out + k * order);
  }
  for (int k = p + 1; k <= derivatives; ++k) std::fill_n(out + k * order, order, 0.0);
}

// The values from the reciprocals of the divisors, in the order in which they are met.
template <int kFixed>
void fill_values(const double* U, int degree, double t, const double* reciprocals, double* out) {
  const int p = kFixed > 0 ? kFixed : degree;
  out[0] = 1;
  for (int d = 1; d <= p; ++d) {
    double carried = 0;
    for (int j = 0; j < d; ++j) {
      const double share = out[j] * *reciprocals++;
      out[j] = carried + share * (U[1 + j] - t);
      carried = share * (t - U[1 - d + j]);
    }
    out[d] = carried;
  }
}

}  // namespace

void SpanBasis::values(int span, double t, double* out) {
  const double* U = knots_.knots().data() + span;
  const int p = knots_.degree();
  if (span != span_) {
    span_ = span;
    double* next = reciprocals_.data();
    for (int d = 1; d <= p; ++d) {
      for (int j = 0; j < d; ++j) *next++ = 1 / (U[1 + j] - U[1 - d + j]);
    }
  }
  switch (p) {
    case 3:
      return fill_values<3>(U, p, t, reciprocals_.data(), out);
    case 5:
      return fill_values<5>(U, p, t, reciprocals_.data(), out);
    default:
      return fill_values<0>(U, p, t, reciprocals_.data(), out);
  }
}

void basis_on_span(const KnotVector& knots, int span, double t, int derivatives, double* out) {
  const double* U = knots.knots().data() + span;
  switch (const int p = knots.degree()) {
    case 1:
      return fill<1>(U, p, t, derivatives, out);
    case 2:
      return fill<2>(U, p, t, derivatives, out);
    case 3:
      return fill<3>(U, p, t, derivatives, out);
    case 4:
      return fill<4>(U, p, t, derivatives, out);
    case 5:
      return fill<5>(U, p, t, derivatives, out);
    case 6:
      return fill<6>(U, p, t, derivatives, out);
    case 7:
      return fill<7>(U, p, t, derivatives, out);
    default:
      return fill<0>(U, p, t, derivatives, out);
  }
}

BasisValues basis_at(const KnotVector& knots, double t, int derivatives, int span_hint) {
  EXPECTS(derivatives >= 0 && derivatives <= KnotVector::kMaxDegree);
  const int span = knots.span(t, span_hint);
  BasisValues result{span - knots.degree(), BasisValues::Matrix(derivatives + 1, knots.order())};
  basis_on_span(knots, span, t, derivatives, result.values.data());
  return result;
}

}  // namespace angiospline
