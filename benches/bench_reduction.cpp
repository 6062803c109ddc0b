#include <cmath>

#include <benchmark/benchmark.h>

#include "benches/kernel_samples.h"
#include "benches/sisl_peer.h"
#include "kernel/reduce/reduce.h"
#include "kernel/refine/periodic.h"

namespace angiospline::bench {
namespace {

// Arguments: minus the decimal logarithm of the tolerance; noise 2e-4 on the control points or
// none; control points.
BSplineCurve<3> reduction_input(const benchmark::State& state) {
  return helix(static_cast<int>(state.range(2)), state.range(1) != 0 ? 2e-4 : 0.0);
}
double tolerance(const benchmark::State& state) {
  return std::pow(10.0, -static_cast<double>(state.range(0)));
}

void reduce_helix(benchmark::State& state) {
  const BSplineCurve<3> curve = reduction_input(state);
  ReductionOptions options;
  options.tolerance = tolerance(state);
  for (auto _ : state) benchmark::DoNotOptimize(reduce(curve, options));
  const ReducedCurve<3> reduced = *reduce(curve, options);
  state.counters["control_points"] = reduced.curve.knots().control_point_count();
  state.counters["error_per_tolerance"] =
      largest_distance(curve, reduced.curve) / options.tolerance;
}

void helix_cases(benchmark::internal::Benchmark* b) {
  for (int noise = 0; noise < 2; ++noise) {
    for (int digits = 2; digits <= 6; ++digits) b->Args({digits, noise, 1000});
  }
  b->Unit(benchmark::kMillisecond);
}
// The last two: ten and a hundred times the control points.
BENCHMARK(reduce_helix)->Apply(helix_cases)->Args({3, 0, 10000})->Args({3, 0, 100000});

// A closed ring, closed in both directions; no peer keeps it closed.
void reduce_ring(benchmark::State& state) {
  const BSplineSurface<3> surface = ring(120, 60);
  SurfaceReductionOptions options;
  options.tolerance = tolerance(state);
  options.held_u0 = options.held_u1 = options.held_v0 = options.held_v1 = 0;
  for (auto _ : state) benchmark::DoNotOptimize(reduce(surface, options));
  const ReducedSurface<3> reduced = *reduce(surface, options);
  state.counters["control_points"] = static_cast<double>(*periodic_count(reduced.surface.u())) *
                                     static_cast<double>(*periodic_count(reduced.surface.v()));
  state.counters["error_per_tolerance"] =
      largest_distance(surface, reduced.surface) / options.tolerance;
}
BENCHMARK(reduce_ring)->Arg(2)->Arg(3)->Arg(4)->Unit(benchmark::kMillisecond);

void reduce_tube(benchmark::State& state) {
  const BSplineSurface<3> surface = tube(300, 60);
  SurfaceReductionOptions options;
  options.tolerance = tolerance(state);
  for (auto _ : state) benchmark::DoNotOptimize(reduce(surface, options));
  const ReducedSurface<3> reduced = *reduce(surface, options);
  state.counters["control_points"] = static_cast<double>(reduced.surface.control_points().cols());
  state.counters["error_per_tolerance"] =
      largest_distance(surface, reduced.surface) / options.tolerance;
}
BENCHMARK(reduce_tube)->Arg(2)->Arg(3)->Arg(4)->Unit(benchmark::kMillisecond);

#ifdef ANGIOSPLINE_HAS_SISL
void reduce_helix_sisl(benchmark::State& state) {
  const BSplineCurve<3> curve = reduction_input(state);
  const SislCurve peer = to_sisl(curve);
  const double t = tolerance(state);
  double allowed[3] = {t, t, t};  // by component: SISL has no Euclidean tolerance
  double error[3];
  SislCurve reduced;
  for (auto _ : state) {
    SISLCurve* result = nullptr;
    int status = 0;
    s1940(peer.get(), allowed, 1, 1, 1, 5, &result, error, &status);
    reduced.reset(result);
  }
  state.counters["control_points"] = reduced->in;
  state.counters["error_per_tolerance"] = largest_distance(curve, from_sisl(*reduced)) / t;
}
BENCHMARK(reduce_helix_sisl)->Apply(helix_cases);

// Ours and SISL's in turn: counter `ratio` is our time over theirs.
void reduce_helix_in_turn(benchmark::State& state) {
  const BSplineCurve<3> curve = reduction_input(state);
  const SislCurve peer = to_sisl(curve);
  const double t = tolerance(state);
  ReductionOptions options;
  options.tolerance = t;
  double ratio = 0;
  for (auto _ : state) {
    ratio = ratio_in_turn([&] { benchmark::DoNotOptimize(reduce(curve, options)); },
                          [&] {
                            double allowed[3] = {t, t, t};
                            double error[3];
                            SISLCurve* result = nullptr;
                            int status = 0;
                            s1940(peer.get(), allowed, 1, 1, 1, 5, &result, error, &status);
                            benchmark::DoNotOptimize(SislCurve(result).get());
                          });
  }
  state.counters["ratio"] = ratio;
}
BENCHMARK(reduce_helix_in_turn)->Apply(helix_cases)->Iterations(1);

// The same against both orders of s1965.
void reduce_tube_in_turn(benchmark::State& state) {
  const BSplineSurface<3> surface = tube(300, 60);
  const SislSurface peer = to_sisl(surface);
  const double t = tolerance(state);
  SurfaceReductionOptions options;
  options.tolerance = t;
  double ratio = 0;
  for (auto _ : state) {
    ratio = ratio_in_turn([&] { benchmark::DoNotOptimize(reduce(surface, options)); },
                          [&] {
                            double allowed[3] = {t, t, t};
                            double at_edges[12];
                            for (double& e : at_edges) e = t;
                            int held[4] = {1, 1, 1, 1};
                            double error[3];
                            SISLSurf* result = nullptr;
                            int status = 0;
                            s1965(peer.get(), allowed, held, 1, 1, at_edges,
                                  static_cast<int>(state.range(1)), 5, &result, error, &status);
                            benchmark::DoNotOptimize(SislSurface(result).get());
                          });
  }
  state.counters["ratio"] = ratio;
}
BENCHMARK(reduce_tube_in_turn)->ArgsProduct({{2, 3, 4}, {3, 4}})->Iterations(1);

// Argument 1: s1965's order, 3 or 4.
void reduce_tube_sisl(benchmark::State& state) {
  const BSplineSurface<3> surface = tube(300, 60);
  const SislSurface peer = to_sisl(surface);
  const double t = tolerance(state);
  double allowed[3] = {t, t, t};
  double at_edges[12];
  for (double& e : at_edges) e = t;
  int held[4] = {1, 1, 1, 1};
  double error[3];
  SislSurface reduced;
  for (auto _ : state) {
    SISLSurf* result = nullptr;
    int status = 0;
    s1965(peer.get(), allowed, held, 1, 1, at_edges, static_cast<int>(state.range(1)), 5, &result,
          error, &status);
    reduced.reset(result);
  }
  state.counters["control_points"] = reduced->in1 * reduced->in2;
  state.counters["error_per_tolerance"] = largest_distance(surface, from_sisl(*reduced)) / t;
}
BENCHMARK(reduce_tube_sisl)->ArgsProduct({{2, 3, 4}, {3, 4}})->Unit(benchmark::kMillisecond);
#endif

}  // namespace
}  // namespace angiospline::bench
