#include "kernel/spline/knot_vector.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/contract.h"

namespace angiospline {
namespace {

Error knot_error(std::string what, std::size_t index, double value, std::string rule) {
  return Error{ErrorKind::kBadInput, std::move(what), "knot " + std::to_string(index),
               std::to_string(value), std::move(rule)};
}

}  // namespace

Result<KnotVector> KnotVector::make(int degree, std::vector<double> knots) {
  if (degree < 0) {
    return fail({ErrorKind::kBadInput, "degree is negative", "knot vector", std::to_string(degree),
                 "degree must be at least 0"});
  }
  if (degree > kMaxDegree) {
    return fail({ErrorKind::kBadInput, "degree is too high", "knot vector", std::to_string(degree),
                 "degree must be at most " + std::to_string(kMaxDegree)});
  }

  const std::size_t order = static_cast<std::size_t>(degree) + 1;
  if (knots.size() < 2 * order) {
    return fail({ErrorKind::kBadInput, "too few knots", "knot vector", std::to_string(knots.size()),
                 "at least 2 (degree + 1) knots are needed"});
  }

  // One pass without a reason to stop for knots that are sound; only others are searched for the
  // first fault. NaN fails every comparison, and finite ends bound what lies between.
  bool sound = std::isfinite(knots.front()) && std::isfinite(knots.back());
  for (std::size_t i = 1; i < knots.size(); ++i) sound &= knots[i - 1] <= knots[i];
  for (std::size_t i = order; i < knots.size(); ++i) sound &= knots[i - order] < knots[i];

  std::size_t run = 1;
  for (std::size_t i = 0; !sound && i < knots.size(); ++i) {
    if (!std::isfinite(knots[i])) {
      return fail(knot_error("knot is not finite", i, knots[i], "knots must be finite"));
    }
    if (i == 0) continue;
    if (knots[i] < knots[i - 1]) {
      return fail(knot_error("knot decreases", i, knots[i], "knots must not decrease"));
    }
    run = knots[i] == knots[i - 1] ? run + 1 : 1;
    if (run > order) {
      return fail(knot_error("multiplicity exceeds the order", i, knots[i],
                             "multiplicity must be at most degree + 1"));
    }
  }

  if (!(knots[order - 1] < knots[knots.size() - order])) {
    return fail(knot_error("domain is empty", order - 1, knots[order - 1],
                           "knot(degree) must be below knot(control_point_count)"));
  }
  return KnotVector(degree, std::move(knots));
}

KnotVector KnotVector::bezier(int degree, double first, double last) {
  return clamped(degree, {first, last});
}

KnotVector KnotVector::clamped(int degree, const std::vector<double>& breakpoints,
                               int multiplicity) {
  EXPECTS(degree >= 0 && degree <= kMaxDegree && breakpoints.size() >= 2);
  EXPECTS(multiplicity >= 1 && multiplicity <= degree + 1);
  std::vector<double> knots;
  for (std::size_t i = 0; i < breakpoints.size(); ++i) {
    EXPECTS(i == 0 || breakpoints[i - 1] < breakpoints[i]);
    const bool end = i == 0 || i + 1 == breakpoints.size();
    knots.insert(knots.end(), static_cast<std::size_t>(end ? degree + 1 : multiplicity),
                 breakpoints[i]);
  }
  return KnotVector(degree, std::move(knots));
}

int KnotVector::span(double t, int hint) const {
  const int low = degree_;
  const int high = control_point_count();
  if (hint >= low && hint < high && (*this)[hint] <= t && t < (*this)[hint + 1]) return hint;
  const auto begin = knots_.begin() + low;
  const auto end = knots_.begin() + high;
  if (t >= *end) {  // the last span of positive length
    return static_cast<int>(std::lower_bound(begin, end, *end) - knots_.begin()) - 1;
  }
  const auto above = std::upper_bound(begin, end, std::max(t, *begin));
  return static_cast<int>(above - knots_.begin()) - 1;
}

double KnotVector::greville(int i) const {
  EXPECTS(i >= 0 && i < control_point_count());
  if (degree_ == 0) return 0.5 * ((*this)[i] + (*this)[i + 1]);
  // Differences from the first knot: exact where all are equal, and never outside the knots.
  const double base = (*this)[i + 1];
  double sum = 0;
  for (int k = i + 2; k <= i + degree_; ++k) sum += (*this)[k] - base;
  return std::min(base + sum / degree_, (*this)[i + degree_]);
}

std::vector<double> KnotVector::greville() const {
  std::vector<double> nodes;
  for (int i = 0; i < control_point_count(); ++i) nodes.push_back(greville(i));
  return nodes;
}

std::vector<double> KnotVector::breakpoints() const {
  std::vector<double> distinct;
  for (int i = degree_; i <= control_point_count(); ++i) {
    if (distinct.empty() || (*this)[i] != distinct.back()) distinct.push_back((*this)[i]);
  }
  return distinct;
}

int KnotVector::multiplicity(double t) const {
  return static_cast<int>(std::count(knots_.begin(), knots_.end(), t));
}

}  // namespace angiospline
