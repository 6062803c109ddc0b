#include "kernel/reduce.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "base/contract.h"
#include "kernel/fit.h"
#include "kernel/reduce_engine.h"
#include "kernel/refinement.h"
#include "kernel/reshape.h"

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

template <int D>
Result<ReducedCurve<D>> reduce(const BSplineCurve<D>& curve, const ReductionOptions& options) {
  if (auto error = reduction_option_error(curve.knots(), options.tolerance, options.held_first,
                                          options.held_last)) {
    return fail(*error);
  }
  const ReductionProblem problem{curve.knots(),
                                 curve.control_points().data(),
                                 D,
                                 D,
                                 options.tolerance,
                                 options.held_first,
                                 options.held_last,
                                 options.kept,
                                 options.polish};
  DirectionResult result = reduce_direction(problem);
  const int count = result.knots.control_point_count();
  typename BSplineCurve<D>::ControlPoints points =
      Eigen::Map<const typename BSplineCurve<D>::ControlPoints>(result.points.data(), D, count);
  return ReducedCurve<D>{BSplineCurve<D>(std::move(result.knots), std::move(points)),
                         result.error_bound, result.trials};
}

namespace {

std::vector<double> interior_knots(const KnotVector& knots) {
  std::vector<double> interior;
  for (const double t : knots.knots()) {
    if (t > knots.first() && t < knots.last()) interior.push_back(t);
  }
  return interior;
}

// One direction of a net: blocks of the other direction's control points. Where there are many of
// those, knots are sought on a few lines across the net, a little inside the tolerance, and then
// have to do for all.
template <int D>
DirectionResult reduce_u(const BSplineSurface<D>& surface, double tolerance,
                         const SurfaceReductionOptions& options) {
  constexpr int kLines = 12;
  const int lines = surface.v_count();
  ReductionProblem problem{surface.u(),     surface.control_points().data(),
                           D * lines,       D,
                           tolerance,       options.held_u0,
                           options.held_u1, options.kept_u,
                           options.polish};
  const int step = lines / kLines;
  if (step < 2) return reduce_direction(problem);
  const int kept = (lines - 1) / step + 1;
  Eigen::Matrix<double, D, Eigen::Dynamic> few(D,
                                               static_cast<Eigen::Index>(surface.u_count()) * kept);
  for (int i = 0; i < surface.u_count(); ++i) {
    for (int j = 0; j < kept; ++j) {
      few.col(static_cast<Eigen::Index>(i) * kept + j) = surface.control_point(i, j * step);
    }
  }
  int trials = 0;
  for (const double caution : {0.97, 0.85, 0.6}) {
    ReductionProblem sketch = problem;
    sketch.points = few.data();
    sketch.stride = D * kept;
    sketch.tolerance = caution * tolerance;
    const DirectionResult found = reduce_direction(sketch);
    trials += found.trials;
    if (auto result = fit_direction(problem, interior_knots(found.knots))) {
      result->trials += trials;
      return std::move(*result);
    }
  }
  DirectionResult result = reduce_direction(problem);
  result.trials += trials;
  return result;
}

template <int D>
BSplineSurface<D> with_u(const BSplineSurface<D>& surface, DirectionResult result) {
  typename BSplineSurface<D>::ControlPoints net =
      Eigen::Map<const typename BSplineSurface<D>::ControlPoints>(
          result.points.data(), D, static_cast<Eigen::Index>(result.points.size()) / D);
  return BSplineSurface<D>(std::move(result.knots), surface.v(), std::move(net));
}

SurfaceReductionOptions swapped(const SurfaceReductionOptions& o) {
  return {o.tolerance, o.held_v0, o.held_v1, o.held_u0, o.held_u1, o.kept_v, o.kept_u, o.polish};
}

// The bound on a difference of surfaces: along v the net is in the original's or the union's
// control points, so the hull argument holds in both directions.
template <int D>
double surface_difference(const BSplineSurface<D>& a, const BSplineSurface<D>& b, double enough) {
  const KnotVector v = merged_knots(a.v(), b.v());
  const BSplineSurface<D> fine_a = refine(a, a.u(), v);
  const BSplineSurface<D> fine_b = refine(b, b.u(), v);
  return difference_bound(a.u(), fine_a.control_points().data(), b.u(),
                          fine_b.control_points().data(), D * v.control_point_count(), D, enough);
}

// u, then v with what is left of the tolerance. The two errors add up at worst; as they seldom do,
// v may try again with the tolerance that the true sum would allow.
template <int D>
ReducedSurface<D> reduce_u_first(const BSplineSurface<D>& surface, double share,
                                 const SurfaceReductionOptions& options) {
  DirectionResult along_u = reduce_u(surface, share * options.tolerance, options);
  int trials = along_u.trials;
  const double left = options.tolerance - along_u.error_bound;
  const BSplineSurface<D> half = swap_uv(with_u(surface, std::move(along_u)));
  const SurfaceReductionOptions options_v = swapped(options);
  ReducedSurface<D> best{surface, 0.0, 0, ReductionOrder::kUFirst};
  double tolerance = left;
  for (int pass = 0; pass < 2; ++pass) {
    DirectionResult along_v = reduce_u(half, tolerance, options_v);
    trials += along_v.trials;
    BSplineSurface<D> candidate = swap_uv(with_u(half, std::move(along_v)));
    const bool fewer = pass == 0 || candidate.v_count() < best.surface.v_count();
    if (!fewer) break;
    const double bound = surface_difference(surface, candidate, options.tolerance);
    if (pass > 0 && !(bound <= options.tolerance)) break;
    best.surface = std::move(candidate);
    best.error_bound = std::min(bound, options.tolerance);
    if (bound > 0.95 * options.tolerance || !(bound > 0)) break;
    tolerance = std::min(options.tolerance, tolerance * options.tolerance / bound);
  }
  best.trials = trials;
  return best;
}

}  // namespace

template <int D>
Result<ReducedSurface<D>> reduce(const BSplineSurface<D>& surface,
                                 const SurfaceReductionOptions& options) {
  for (const bool along_u : {true, false}) {
    auto error = reduction_option_error(along_u ? surface.u() : surface.v(), options.tolerance,
                                        along_u ? options.held_u0 : options.held_v0,
                                        along_u ? options.held_u1 : options.held_v1);
    if (!error) continue;
    error->where += along_u ? ", u direction" : ", v direction";
    return fail(*error);
  }
  constexpr double kShare = 0.6;  // of the tolerance for the direction that goes first
  ReducedSurface<D> u_first = reduce_u_first(surface, kShare, options);
  ReducedSurface<D> v_first = reduce_u_first(swap_uv(surface), kShare, swapped(options));
  const int trials = u_first.trials + v_first.trials;
  const auto size = [](const ReducedSurface<D>& s) { return s.surface.control_points().cols(); };
  if (size(v_first) < size(u_first)) {
    return ReducedSurface<D>{swap_uv(v_first.surface), v_first.error_bound, trials,
                             ReductionOrder::kVFirst};
  }
  u_first.trials = trials;
  return u_first;
}

#define ANGIOSPLINE_INSTANTIATE(D)                                    \
  template Result<ReducedSurface<D>> reduce(const BSplineSurface<D>&, \
                                            const SurfaceReductionOptions&);
ANGIOSPLINE_INSTANTIATE(2)
ANGIOSPLINE_INSTANTIATE(3)
ANGIOSPLINE_INSTANTIATE(4)
#undef ANGIOSPLINE_INSTANTIATE

template <int D>
Result<ReducedCurve<D>> fit_to_tolerance(int degree, const std::vector<double>& parameters,
                                         const Eigen::Matrix<double, D, Eigen::Dynamic>& points,
                                         double tolerance) {
  const std::size_t count = parameters.size();
  if (degree < 1 || count < static_cast<std::size_t>(degree) + 1) {
    return fail({ErrorKind::kBadInput, "too few points", "fit to tolerance", std::to_string(count),
                 "at least the order, " + std::to_string(degree + 1) + ", are needed"});
  }
  const std::size_t p = static_cast<std::size_t>(degree);
  std::vector<double> flat(p + 1, parameters.front());
  for (std::size_t j = 1; j + p < count; ++j) {
    double sum = 0;
    for (std::size_t k = j; k < j + p; ++k) sum += parameters[k];
    flat.push_back(sum / degree);
  }
  flat.insert(flat.end(), p + 1, parameters.back());
  const Result<KnotVector> knots = KnotVector::make(degree, std::move(flat));
  if (!knots) return fail(knots.error());
  const Result<BSplineCurve<D>> through = interpolate<D>(*knots, parameters, points);
  if (!through) return fail(through.error());
  ReductionOptions options;
  options.tolerance = tolerance;
  return reduce(*through, options);
}

#define ANGIOSPLINE_INSTANTIATE(D)                                                               \
  template Result<ReducedCurve<D>> fit_to_tolerance(                                             \
      int, const std::vector<double>&, const Eigen::Matrix<double, D, Eigen::Dynamic>&, double); \
  template Result<ReducedCurve<D>> reduce(const BSplineCurve<D>&, const ReductionOptions&);
ANGIOSPLINE_INSTANTIATE(1)
ANGIOSPLINE_INSTANTIATE(2)
ANGIOSPLINE_INSTANTIATE(3)
ANGIOSPLINE_INSTANTIATE(4)
#undef ANGIOSPLINE_INSTANTIATE

}  // namespace angiospline
