#include "kernel/spline/binomial.h"

#include <array>

#include "base/contract.h"
#include "base/index.h"
#include "kernel/spline/knot_vector.h"

namespace angiospline {

double binomial(int n, int k) {
  constexpr int kRows = 2 * KnotVector::kMaxDegree + 1;
  static constexpr auto kPascal = [] {
    std::array<std::array<double, kRows>, kRows> row{};
    for (std::size_t i = 0; i < kRows; ++i) {
      row[i][0] = 1;
      for (std::size_t j = 1; j <= i; ++j) row[i][j] = row[i - 1][j - 1] + row[i - 1][j];
    }
    return row;
  }();
  EXPECTS(n >= 0 && n < kRows);
  return k < 0 || k > n ? 0.0 : kPascal[index(n)][index(k)];
}

}  // namespace angiospline
