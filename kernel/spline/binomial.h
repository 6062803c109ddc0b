// Binomial coefficients: what weights products of Bernstein forms.
#pragma once

namespace angiospline {

// n over k; 0 where k < 0 or k > n. Exact up to n = 57, correct to a few ulps above. Requires
// 0 <= n <= 2 kMaxDegree: the degree of a product of two splines.
double binomial(int n, int k);

}  // namespace angiospline
