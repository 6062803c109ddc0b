#include "kernel/reduce/reduce.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/contract.h"
#include "kernel/fit/fit.h"
#include "kernel/reduce/reduce_engine.h"
#include "kernel/refine/difference_bound.h"
#include "kernel/refine/periodic.h"
#include "kernel/refine/refinement.h"
#include "kernel/refine/reshape.h"
#include "kernel/refine/split.h"

namespace angiospline {
namespace {

// The first broken requirement of the options, or nothing.
std::optional<Error> reduction_option_error(const KnotVector& knots, double tolerance,
                                            int held_first, int held_last) {
  const auto error = [](std::string what, std::string value, std::string rule) {
    return Error{ErrorKind::kBadInput, std::move(what), "data reduction", std::move(value),
                 std::move(rule)};
  };
  if (!(tolerance > 0) || !std::isfinite(tolerance)) {
    return error("tolerance is not positive", std::to_string(tolerance), "must be above 0");
  }

  const int most = knots.order() / 2;
  if (held_first < 0 || held_last < 0 || held_first > most || held_last > most) {
    return error("wrong number of held derivatives",
                 std::to_string(held_first) + " and " + std::to_string(held_last),
                 "0 to half the order, " + std::to_string(most) + ", at each end");
  }

  const bool clamped_first = knots.knots().front() == knots.first();
  const bool clamped_last = knots.knots().back() == knots.last();
  if ((held_first > 0 && !clamped_first) || (held_last > 0 && !clamped_last)) {
    return error("an end is held on floating knots", {}, "clamp the ends, or hold nothing there");
  }
  return std::nullopt;
}

}  // namespace

template <int D>
Result<ReducedCurve<D>> reduce(const BSplineCurve<D>& curve, const ReductionOptions& options) {
  if (auto error = reduction_option_error(curve.knots(), options.tolerance, options.held_first,
                                          options.held_last)) {
    return fail(*error);
  }

  const ReductionProblem problem{.knots = curve.knots(),
                                 .points = curve.control_points().data(),
                                 .stride = D,
                                 .group = D,
                                 .tolerance = options.tolerance,
                                 .held_first = options.held_first,
                                 .held_last = options.held_last,
                                 .kept = options.kept,
                                 .polish = options.polish,
                                 .closed = is_periodic(curve)};

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
                         const SurfaceReductionOptions& options, Proof proof) {
  constexpr int kLines = 8;
  const int lines = surface.v_count();
  const ReductionProblem problem{.knots = surface.u(),
                                 .points = surface.control_points().data(),
                                 .stride = D * lines,
                                 .group = D,
                                 .tolerance = tolerance,
                                 .held_first = options.held_u0,
                                 .held_last = options.held_u1,
                                 .kept = options.kept_u,
                                 .polish = options.polish,
                                 .closed = is_periodic_u(surface),
                                 .proof = proof};

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

  // Lines between the kept ones may be farther off: ask more of those kept until all agree.
  int trials = 0;
  for (const double caution : {0.97, 0.85, 0.6}) {
    ReductionProblem sketch = problem;
    sketch.points = few.data();
    sketch.stride = D * kept;
    sketch.tolerance = caution * tolerance;
    sketch.proof = Proof::kSamples;  // all lines have the last word
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
  if (!same_ends(a.v(), b.v())) {  // closed: clamped for the bound
    return surface_difference(restrict_v(a, a.v().first(), a.v().last()),
                              restrict_v(b, b.v().first(), b.v().last()), enough);
  }
  const KnotVector v = merged_knots(a.v(), b.v());
  const BSplineSurface<D> fine_a = refine(a, a.u(), v);
  const BSplineSurface<D> fine_b = refine(b, b.u(), v);
  return difference_bound(a.u(), fine_a.control_points().data(), b.u(),
                          fine_b.control_points().data(), D * v.control_point_count(), D, enough);
}

// u, then v with what is left of the tolerance. The two errors add up at worst; as they seldom do,
// v may try again with the tolerance that the true sum would allow. With Proof::kSamples the bound
// of the whole is what counts, and may turn out above the tolerance.
template <int D>
ReducedSurface<D> reduce_u_first(const BSplineSurface<D>& surface, double share,
                                 const SurfaceReductionOptions& options, Proof proof) {
  DirectionResult along_u = reduce_u(surface, share * options.tolerance, options, proof);
  int trials = along_u.trials;
  const double left = options.tolerance - along_u.error_bound;
  const BSplineSurface<D> half = swap_uv(with_u(surface, std::move(along_u)));
  const SurfaceReductionOptions options_v = swapped(options);

  ReducedSurface<D> best{surface, 0.0, 0, ReductionOrder::kUFirst};
  double tolerance = left;
  for (int pass = 0; pass < 2; ++pass) {
    DirectionResult along_v = reduce_u(half, tolerance, options_v, proof);
    trials += along_v.trials;
    BSplineSurface<D> candidate = swap_uv(with_u(half, std::move(along_v)));

    const bool fewer = pass == 0 || candidate.v_count() < best.surface.v_count();
    if (!fewer) break;
    const double bound = surface_difference(surface, candidate, options.tolerance);
    if (pass > 0 && !(bound <= options.tolerance)) break;
    best.surface = std::move(candidate);
    best.error_bound = proof == Proof::kBound ? std::min(bound, options.tolerance) : bound;
    // By the order of convergence the rest of the tolerance is worth so many control points.
    const double order = best.surface.v().order();
    const double worth =
        best.surface.v_count() * (1 - std::pow(bound / options.tolerance, 1 / order));
    if (worth < 0.5 || !(bound > 0)) break;
    tolerance = std::min(options.tolerance, tolerance * options.tolerance / bound);
  }

  best.trials = trials;
  return best;
}

// The samples first, which is cheaper; where the bound does not agree, bounds all the way.
template <int D>
ReducedSurface<D> reduce_u_first(const BSplineSurface<D>& surface,
                                 const SurfaceReductionOptions& options) {
  constexpr double kShare = 0.6;  // of the tolerance for the direction that goes first
  ReducedSurface<D> sampled = reduce_u_first(surface, kShare, options, Proof::kSamples);
  if (sampled.error_bound <= options.tolerance) return sampled;
  ReducedSurface<D> proved = reduce_u_first(surface, kShare, options, Proof::kBound);
  proved.trials += sampled.trials;
  return proved;
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

  ReducedSurface<D> u_first = reduce_u_first(surface, options);
  ReducedSurface<D> v_first = reduce_u_first(swap_uv(surface), swapped(options));
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

  // Knots at means of p parameters (de Boor): the Schoenberg-Whitney conditions hold then.
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
