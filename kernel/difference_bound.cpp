#include "kernel/difference_bound.h"

#include <algorithm>
#include <cmath>

#include "base/contract.h"
#include "kernel/knot_algebra.h"
#include "kernel/refinement.h"

namespace angiospline {
namespace {

// Cuts in four every span that one of the marked functions reaches.
KnotVector quartered(const KnotVector& knots, const std::vector<int>& functions) {
  std::vector<double> added;
  int next = 0;  // spans before this one are done
  for (const int i : functions) {
    for (int k = std::max(i, next); k <= i + knots.degree(); ++k, next = k) {
      const double from = std::max(knots[k], knots.first());
      const double to = std::min(knots[k + 1], knots.last());
      for (int part = 1; part < 4; ++part) {
        const double t = from + 0.25 * part * (to - from);
        if (t > from && t < to) added.push_back(t);
      }
    }
  }
  Result<KnotVector> fine = with_knots(knots, std::move(added));
  EXPECTS(fine.has_value());
  return std::move(*fine);
}

std::size_t size_of(const KnotVector& knots, int stride) {
  return static_cast<std::size_t>(knots.control_point_count()) * static_cast<std::size_t>(stride);
}

KnotVector clamped_ends(const KnotVector& knots) {
  std::vector<Knot> distinct = distinct_knots(knots);
  std::erase_if(distinct,
                [&](const Knot& k) { return k.value < knots.first() || k.value > knots.last(); });
  distinct.front().multiplicity = distinct.back().multiplicity = knots.order();
  Result<KnotVector> clamped = from_distinct(knots.degree(), distinct);
  EXPECTS(clamped.has_value());
  return std::move(*clamped);
}

// Whether the knots outside the open domain are the same.
bool same_ends(const KnotVector& a, const KnotVector& b) {
  const auto outer = [](const KnotVector& knots) {
    std::vector<double> values;
    for (const double t : knots.knots()) {
      if (t <= knots.first() || t >= knots.last()) values.push_back(t);
    }
    return values;
  };
  return outer(a) == outer(b);
}

}  // namespace

double largest_squared(const double* block, int stride, int group) {
  double largest = 0;
  for (int k = 0; k < stride; k += group) {
    double sum = 0;
    for (int c = 0; c < group; ++c) sum += block[k + c] * block[k + c];
    largest = std::max(largest, sum);
  }
  return largest;
}

double largest_norm(const std::vector<double>& blocks, int stride, int group) {
  double largest = 0;
  for (std::size_t k = 0; k < blocks.size(); k += static_cast<std::size_t>(stride)) {
    largest = std::max(largest, largest_squared(blocks.data() + k, stride, group));
  }
  return std::sqrt(largest);
}

double difference_bound(const KnotVector& a_knots, const double* a, const KnotVector& b_knots,
                        const double* b, int stride, int group, double enough) {
  if (!same_ends(a_knots, b_knots)) {
    const KnotVector a_clamped = clamped_ends(a_knots);
    const KnotVector b_clamped = clamped_ends(b_knots);
    std::vector<double> a_points(size_of(a_clamped, stride));
    std::vector<double> b_points(size_of(b_clamped, stride));
    rewriting_matrix(a_knots, a_clamped).apply_blocks(a, stride, a_points.data());
    rewriting_matrix(b_knots, b_clamped).apply_blocks(b, stride, b_points.data());
    return difference_bound(a_clamped, a_points.data(), b_clamped, b_points.data(), stride, group,
                            enough);
  }
  const KnotVector both = merged_knots(a_knots, b_knots);
  std::vector<double> difference(size_of(both, stride));
  add_refined(1, a_knots, both, a, stride, difference.data());
  add_refined(-1, b_knots, both, b, stride, difference.data());
  const double bound = largest_norm(difference, stride, group);
  if (bound <= enough) return bound;
  std::vector<int> beyond;
  for (int i = 0; i < both.control_point_count(); ++i) {
    const double* block = difference.data() + static_cast<std::ptrdiff_t>(i) * stride;
    if (largest_squared(block, stride, group) > enough * enough) beyond.push_back(i);
  }
  const KnotVector fine = quartered(both, beyond);
  std::vector<double> finer(size_of(fine, stride));
  add_refined(1, both, fine, difference.data(), stride, finer.data());
  return std::min(bound, largest_norm(finer, stride, group));
}

}  // namespace angiospline
