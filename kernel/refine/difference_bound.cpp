#include "kernel/refine/difference_bound.h"

#include <algorithm>
#include <cmath>

#include "base/contract.h"
#include "kernel/refine/refinement.h"
#include "kernel/spline/knot_algebra.h"

namespace angiospline {
namespace {

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

// Functions `from` .. `to` of a spline with those that share a span with them, as a spline of its
// own over the spans that `from` .. `to` reach, with these cut in four: its longest group, squared.
double largest_quartered(const KnotVector& knots, int from, int to, const double* blocks,
                         int stride, int group) {
  const int p = knots.degree();
  const int low = std::max(0, from - p);
  const int high = std::min(knots.control_point_count() - 1, to + p);
  const auto begin = knots.knots().begin();
  const Result<KnotVector> part =
      KnotVector::make(p, std::vector<double>(begin + low, begin + high + p + 2));
  if (!part) return 0;  // functions that reach no span of the domain

  std::vector<double> added;
  for (int k = p; k < part->control_point_count(); ++k) {
    const double a = (*part)[k];
    const double b = (*part)[k + 1];
    for (int quarter = 1; quarter < 4; ++quarter) {
      const double t = a + 0.25 * quarter * (b - a);
      if (t > a && t < b) added.push_back(t);
    }
  }

  const Result<KnotVector> fine = with_knots(*part, std::move(added));
  EXPECTS(fine.has_value());
  std::vector<double> finer(size_of(*fine, stride));
  add_refined(1, *part, *fine, blocks + static_cast<std::ptrdiff_t>(low) * stride, stride,
              finer.data());

  double largest = 0;
  for (int i = 0; i < fine->control_point_count(); ++i) {
    largest = std::max(
        largest,
        largest_squared(finer.data() + static_cast<std::ptrdiff_t>(i) * stride, stride, group));
  }
  return largest;
}

}  // namespace

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

double largest_squared(const double* block, int stride, int group) {
  double largest = 0;
  for (int k = 0; k < stride; k += group) {
    double sum = 0;
    for (int c = 0; c < group; ++c) sum += block[k + c] * block[k + c];
    largest = std::max(largest, sum);
  }
  return largest;
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

  // Where a control point is beyond `enough`, the finer ones around it count in its place.
  double bound = 0;
  const int count = both.control_point_count();
  const auto length = [&](int i) {
    return largest_squared(difference.data() + static_cast<std::ptrdiff_t>(i) * stride, stride,
                           group);
  };
  for (int i = 0; i < count; ++i) {
    double here = length(i);
    if (here > enough * enough) {
      int last = i;  // runs of functions that share spans are one
      for (int k = i + 1; k < count && k <= last + both.degree(); ++k) {
        if (length(k) > enough * enough) last = k;
      }
      here = largest_quartered(both, i, last, difference.data(), stride, group);
      i = last;
    }
    bound = std::max(bound, here);
  }
  return std::sqrt(bound);
}

}  // namespace angiospline
