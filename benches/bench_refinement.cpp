#include <vector>

#include "benches/kernel_samples.h"
#include "benches/sisl_peer.h"
#include <TColStd_Array1OfInteger.hxx>
#include <TColStd_Array1OfReal.hxx>
#include <benchmark/benchmark.h>

#include "kernel/fit.h"
#include "kernel/grid.h"
#include "kernel/refinement.h"
#include "modeling/occt_bspline.h"

namespace angiospline::bench {
namespace {

// A hundred new knots, none of them an old one.
std::vector<double> hundred_knots() {
  std::vector<double> added;
  for (int k = 0; k < 100; ++k) added.push_back((k + 0.4321) / 100);
  return added;
}

// Argument: control points before.
void insert_100_knots(benchmark::State& state) {
  const BSplineCurve<3> curve = helix(static_cast<int>(state.range(0)), 0);
  const std::vector<double> added = hundred_knots();
  for (auto _ : state) benchmark::DoNotOptimize(insert_knots(curve, added));
}
BENCHMARK(insert_100_knots)->Arg(20)->Arg(1000)->Unit(benchmark::kMicrosecond);

void insert_100_knots_occt(benchmark::State& state) {
  const Handle(Geom_BSplineCurve) curve = to_occt(helix(static_cast<int>(state.range(0)), 0));
  const std::vector<double> added = hundred_knots();
  TColStd_Array1OfReal knots(1, 100);
  TColStd_Array1OfInteger once(1, 100);
  once.Init(1);
  for (int k = 0; k < 100; ++k) knots.SetValue(k + 1, added[static_cast<std::size_t>(k)]);
  for (auto _ : state) {
    const Handle(Geom_BSplineCurve) copy = Handle(Geom_BSplineCurve)::DownCast(curve->Copy());
    copy->InsertKnots(knots, once);
    benchmark::DoNotOptimize(copy.get());
  }
}
BENCHMARK(insert_100_knots_occt)->Arg(20)->Arg(1000)->Unit(benchmark::kMicrosecond);

void insert_100_knots_surface(benchmark::State& state) {
  const BSplineSurface<3> surface = sheet();
  for (auto _ : state) {
    const KnotVector fine = *with_knots(surface.u(), hundred_knots());
    benchmark::DoNotOptimize(refine(surface, fine, fine));
  }
}
BENCHMARK(insert_100_knots_surface)->Unit(benchmark::kMicrosecond);

// Linear in size: n, 10 n, 100 n control points, every span halved; and least squares.
void halve_all_spans(benchmark::State& state) {
  const BSplineCurve<3> curve = helix(static_cast<int>(state.range(0)), 0);
  const std::vector<double> breaks = curve.knots().breakpoints();
  std::vector<double> added;
  for (std::size_t k = 0; k + 1 < breaks.size(); ++k) {
    added.push_back(0.5 * (breaks[k] + breaks[k + 1]));
  }
  for (auto _ : state) benchmark::DoNotOptimize(insert_knots(curve, added));
}
BENCHMARK(halve_all_spans)->Arg(100)->Arg(1000)->Arg(10000)->Unit(benchmark::kMicrosecond);

void fit_least_squares(benchmark::State& state) {
  const int count = static_cast<int>(state.range(0));
  const auto parameters = spaced(0, 1, 4 * count);
  const Eigen::Matrix3Xd points = evaluate(helix(count, 1e-3), parameters);
  const KnotVector knots = uniform_knots(5, count);
  for (auto _ : state) benchmark::DoNotOptimize(fit_curve<3>(knots, parameters, points));
}
BENCHMARK(fit_least_squares)->Arg(100)->Arg(1000)->Arg(10000)->Unit(benchmark::kMicrosecond);

#ifdef ANGIOSPLINE_HAS_SISL
void insert_100_knots_sisl(benchmark::State& state) {
  const SislCurve curve = to_sisl(helix(static_cast<int>(state.range(0)), 0));
  std::vector<double> added = hundred_knots();
  for (auto _ : state) {
    SISLCurve* fine = nullptr;
    int status = 0;
    s1018(curve.get(), added.data(), 100, &fine, &status);
    benchmark::DoNotOptimize(SislCurve(fine).get());
  }
}
BENCHMARK(insert_100_knots_sisl)->Arg(20)->Arg(1000)->Unit(benchmark::kMicrosecond);

void insert_100_knots_surface_sisl(benchmark::State& state) {
  const SislSurface surface = to_sisl(sheet());
  std::vector<double> added = hundred_knots();
  for (auto _ : state) {
    SISLSurf* fine = nullptr;
    int status = 0;
    s1025(surface.get(), added.data(), 100, added.data(), 100, &fine, &status);
    benchmark::DoNotOptimize(SislSurface(fine).get());
  }
}
BENCHMARK(insert_100_knots_surface_sisl)->Unit(benchmark::kMicrosecond);
#endif

}  // namespace
}  // namespace angiospline::bench
