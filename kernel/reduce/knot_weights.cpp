#include <algorithm>
#include <cmath>

#include "kernel/reduce/reduce.h"

namespace angiospline {

namespace {

// Boehm's factor of row k when z, the last of its equals at `last`, is what gets inserted: new
// control point k is (1 - factor) * old(k - 1) + factor * old(k).
double insertion_factor(const double* knots, int p, int last, int k) {
  if (k < last - p) return 1;
  if (k >= last) return 0;
  return k == last - 1 - p ? 1.0 : (knots[last] - knots[k]) / (knots[k + p + 1] - knots[k]);
}

// Without knot z the p + 2 control points d(last - 1 - p) .. d(last) must come from p + 1 by
// Boehm's insertion; the one condition v'd = 0 says whether they do, and |v'd| / |v|_1 is how far,
// in the largest coefficient, they are from it.
double weight_of_last(const double* knots, int p, int last, const double* points, int stride,
                      int group, std::vector<double>& value) {
  std::fill(value.begin(), value.end(), 0.0);
  double v = 1;
  double norm = 0;
  double alpha = 1;
  const int mu = last - 1;
  for (int k = mu - p; k <= mu + 1; ++k) {
    if (k > mu - p) {
      const double next = k <= mu ? (knots[last] - knots[k]) / (knots[k + p + 1] - knots[k]) : 0.0;
      v *= -alpha / (1 - next);
      alpha = next;
    }
    norm += std::abs(v);
    const double* block = points + static_cast<std::ptrdiff_t>(k) * stride;
    for (int c = 0; c < stride; ++c) value[static_cast<std::size_t>(c)] += v * block[c];
  }

  double largest = 0;
  for (int c = 0; c < stride; c += group) {
    double sum = 0;
    for (int g = 0; g < group; ++g) {
      const double x = value[static_cast<std::size_t>(c + g)];
      sum += x * x;
    }
    largest = std::max(largest, sum);
  }
  return std::sqrt(largest) / norm;
}

// Takes the last copy of a knot out of a window of a spline: insertion run backwards, from either
// side to where its factors pass one half, so that nothing is divided by less.
void remove_last(std::vector<double>& knots, int p, int last, std::vector<double>& points,
                 int stride) {
  const int mu = last - 1;
  const auto block = [&](std::vector<double>& of, int k) {
    return of.data() + static_cast<std::ptrdiff_t>(k) * stride;
  };

  std::vector<double> result(points.begin(), points.end() - stride);
  const int count = static_cast<int>(result.size()) / stride;
  for (int k = mu + 1; k < count; ++k) std::copy_n(block(points, k + 1), stride, block(result, k));

  // From the left while the old control point has the larger share, from the right for the rest:
  // each step divides by at least one half.
  int k = mu - p + 1;
  for (; k <= mu; ++k) {
    const double a = insertion_factor(knots.data(), p, last, k);
    if (a < 0.5) break;
    for (int c = 0; c < stride; ++c) {
      block(result, k)[c] = (block(points, k)[c] - (1 - a) * block(result, k - 1)[c]) / a;
    }
  }
  if (mu < count) std::copy_n(block(points, mu + 1), stride, block(result, mu));

  for (int l = mu; l > k; --l) {
    const double a = insertion_factor(knots.data(), p, last, l);
    for (int c = 0; c < stride; ++c) {
      block(result, l - 1)[c] = (block(points, l)[c] - a * block(result, l)[c]) / (1 - a);
    }
  }

  knots.erase(knots.begin() + last);
  points = std::move(result);
}

}  // namespace

std::vector<double> knot_weights(const KnotVector& knots, const double* points, int stride,
                                 int group) {
  const int p = knots.degree();
  const int total = static_cast<int>(knots.knots().size());
  std::vector<double> weights;
  std::vector<double> value(static_cast<std::size_t>(stride));
  for (int j = 0; j < total; ++j) {
    if (!(knots[j] > knots.first() && knots[j] < knots.last())) continue;

    int last = j;
    while (knots[last + 1] == knots[j]) ++last;
    weights.push_back(weight_of_last(knots.knots().data(), p, last, points, stride, group, value));
    if (last == j) continue;

    // Each further copy is weighed once the lighter ones are gone, in a window around the knot.
    const int low = std::max(0, j - p - 2);
    const int high = std::min(total - 1, last + p + 2);
    std::vector<double> window(knots.knots().begin() + low, knots.knots().begin() + high + 1);
    std::vector<double> near(
        points + static_cast<std::ptrdiff_t>(low) * stride,
        points +
            static_cast<std::ptrdiff_t>(std::min(high + 1, knots.control_point_count())) * stride);
    for (; last > j; --last) {
      remove_last(window, p, last - low, near, stride);
      weights.push_back(std::max(
          weights.back(),
          weight_of_last(window.data(), p, last - 1 - low, near.data(), stride, group, value)));
    }
    while (knots[j + 1] == knots[j]) ++j;
  }
  return weights;
}

}  // namespace angiospline
