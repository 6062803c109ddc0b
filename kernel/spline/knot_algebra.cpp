#include "kernel/spline/knot_algebra.h"

#include <algorithm>
#include <cmath>

#include "base/contract.h"

namespace angiospline {
namespace {

// Keeps order knots up to the first end of the domain and from the last one: what a clamped end has
// already, and all that a floating end needs.
KnotVector trimmed(int degree, const std::vector<Knot>& knots, double first, double last) {
  const std::ptrdiff_t order = degree + 1;
  std::vector<double> flat;
  for (const Knot& knot : knots) {
    flat.insert(flat.end(), static_cast<std::size_t>(std::min(knot.multiplicity, degree + 1)),
                knot.value);
  }
  const auto head = std::upper_bound(flat.begin(), flat.end(), first) - flat.begin();
  const auto tail = std::lower_bound(flat.begin(), flat.end(), last) - flat.begin();
  const auto size = static_cast<std::ptrdiff_t>(flat.size());
  EXPECTS(head >= order && size - tail >= order);
  Result<KnotVector> result = KnotVector::make(
      degree, std::vector<double>(flat.begin() + (head - order), flat.begin() + (tail + order)));
  EXPECTS(result.has_value());
  return std::move(*result);
}

bool same_domain(const KnotVector& a, const KnotVector& b) {
  return a.first() == b.first() && a.last() == b.last();
}

// Calls visit(value, multiplicity in a, multiplicity in b) for every distinct value of either.
template <typename Visit>
void for_each_distinct(const KnotVector& a, const KnotVector& b, const Visit& visit) {
  const std::vector<Knot> in_a = distinct_knots(a);
  const std::vector<Knot> in_b = distinct_knots(b);
  std::size_t i = 0;
  std::size_t j = 0;
  while (i < in_a.size() || j < in_b.size()) {
    const bool take_a = j == in_b.size() || (i < in_a.size() && in_a[i].value <= in_b[j].value);
    const bool take_b = i == in_a.size() || (j < in_b.size() && in_b[j].value <= in_a[i].value);
    visit(take_a ? in_a[i].value : in_b[j].value, take_a ? in_a[i].multiplicity : 0,
          take_b ? in_b[j].multiplicity : 0);
    if (take_a) ++i;
    if (take_b) ++j;
  }
}

template <typename Map>
KnotVector mapped(const KnotVector& knots, const Map& map) {
  std::vector<double> values;
  values.reserve(knots.knots().size());
  for (const double t : knots.knots()) values.push_back(map(t));
  if (values.front() > values.back()) std::reverse(values.begin(), values.end());
  Result<KnotVector> result = KnotVector::make(knots.degree(), std::move(values));
  EXPECTS(result.has_value());
  return std::move(*result);
}

}  // namespace

std::vector<Knot> distinct_knots(const KnotVector& knots) {
  std::vector<Knot> distinct;
  for (const double t : knots.knots()) {
    if (distinct.empty() || distinct.back().value != t) distinct.push_back({t, 0});
    ++distinct.back().multiplicity;
  }
  return distinct;
}

Result<KnotVector> from_distinct(int degree, const std::vector<Knot>& knots) {
  std::vector<double> flat;
  for (const Knot& knot : knots) {
    flat.insert(flat.end(), static_cast<std::size_t>(std::max(knot.multiplicity, 0)), knot.value);
  }
  return KnotVector::make(degree, std::move(flat));
}

KnotVector product_knots(const KnotVector& a, const KnotVector& b) {
  EXPECTS(same_domain(a, b));
  const int degree = a.degree() + b.degree();
  EXPECTS(degree <= KnotVector::kMaxDegree);
  std::vector<Knot> knots;
  for_each_distinct(a, b, [&](double value, int in_a, int in_b) {
    knots.push_back(
        {value, std::max(in_a > 0 ? in_a + b.degree() : 0, in_b > 0 ? in_b + a.degree() : 0)});
  });
  return trimmed(degree, knots, a.first(), a.last());
}

KnotVector elevated_knots(const KnotVector& knots, int by) {
  EXPECTS(by >= 0 && knots.degree() + by <= KnotVector::kMaxDegree);
  std::vector<Knot> raised = distinct_knots(knots);
  for (Knot& knot : raised) knot.multiplicity += by;
  return trimmed(knots.degree() + by, raised, knots.first(), knots.last());
}

KnotVector merged_knots(const KnotVector& a, const KnotVector& b) {
  EXPECTS(same_domain(a, b) && a.degree() == b.degree());
  std::vector<Knot> knots;
  for_each_distinct(a, b, [&](double value, int in_a, int in_b) {
    knots.push_back({value, std::max(in_a, in_b)});
  });
  return trimmed(a.degree(), knots, a.first(), a.last());
}

KnotVector with_domain(const KnotVector& knots, double first, double last) {
  EXPECTS(first < last);
  const double from = knots.first();
  const double to = knots.last();
  return mapped(knots, [&](double t) {
    if (t == to) return last;
    return first + (t - from) / (to - from) * (last - first);
  });
}

KnotVector reversed(const KnotVector& knots) {
  const double first = knots.first();
  const double last = knots.last();
  return mapped(knots, [&](double t) {
    if (t == first) return last;
    return t == last ? first : first + (last - t);
  });
}

KnotVector snapped(const KnotVector& knots, const KnotVector& model, double tolerance) {
  EXPECTS(tolerance >= 0);
  const std::vector<double>& M = model.knots();
  return mapped(knots, [&](double t) {
    const auto above = std::lower_bound(M.begin(), M.end(), t);
    if (above != M.end() && *above - t <= tolerance) return *above;
    if (above != M.begin() && t - *(above - 1) <= tolerance) return *(above - 1);
    return t;
  });
}

}  // namespace angiospline
