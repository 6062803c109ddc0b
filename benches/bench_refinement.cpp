#include <cmath>
#include <vector>

#include <TColStd_Array1OfInteger.hxx>
#include <TColStd_Array1OfReal.hxx>
#include <benchmark/benchmark.h>

#include "benches/kernel_samples.h"
#include "benches/sisl_peer.h"
#include "kernel/evaluate/grid.h"
#include "kernel/fit/fit.h"
#include "kernel/refine/control_mesh.h"
#include "kernel/refine/refinement.h"
#include "modeling/solid/occt_bspline.h"

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

// Every span in k pieces, the least k at which the bound is within the tolerance: what refinement
// that does not choose its places would need.
std::vector<double> cut_breaks(const std::vector<double>& breaks, int pieces) {
  std::vector<double> cut;
  for (std::size_t i = 0; i + 1 < breaks.size(); ++i) {
    for (int k = 0; k < pieces; ++k) {
      cut.push_back(breaks[i] + (breaks[i + 1] - breaks[i]) * k / pieces);
    }
  }
  cut.push_back(breaks.back());
  return cut;
}

// A line with one sharp bend; argument: minus the decimal logarithm of the tolerance.
void control_polygon_of_a_bend(benchmark::State& state) {
  const KnotVector knots = uniform_knots(5, 37);
  const auto nodes = knots.greville();
  Eigen::Matrix3Xd points(3, 37);
  for (int i = 0; i < 37; ++i) {
    const double t = nodes[static_cast<std::size_t>(i)];
    points.col(i) << 10 * t, 2 * std::tanh(40 * (t - 0.3)), 0;
  }
  const BSplineCurve<3> curve(knots, points);
  MeshOptions options;
  options.tolerance = std::pow(10.0, -static_cast<double>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(refine_to_tolerance(curve, options));
  state.counters["control_points"] =
      refine_to_tolerance(curve, options)->curve.knots().control_point_count();
  for (int pieces = 1;; ++pieces) {
    const KnotVector fine = KnotVector::clamped(5, cut_breaks(knots.breakpoints(), pieces));
    if (control_polygon_distance(rewrite(curve, fine)) > options.tolerance) continue;
    state.counters["uniform"] = fine.control_point_count();
    break;
  }
}
BENCHMARK(control_polygon_of_a_bend)->Arg(2)->Arg(3)->Arg(4)->Unit(benchmark::kMicrosecond);

// The tube, with a sharp bulge in the middle; pieces of uniform refinement are shared by both
// directions in the ratio that serves it best.
void control_mesh_of_a_bulge(benchmark::State& state) {
  const BSplineSurface<3> straight = tube(40, 16);
  Eigen::Matrix3Xd net = straight.control_points();
  for (int j = 0; j < straight.v_count(); ++j) net.col(straight.index(20, j)) *= 1.05;
  const BSplineSurface<3> surface(straight.u(), straight.v(), net);
  MeshOptions options;
  options.tolerance = std::pow(10.0, -static_cast<double>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(refine_to_tolerance(surface, options));
  state.counters["control_points"] =
      static_cast<double>(refine_to_tolerance(surface, options)->surface.control_points().cols());
  double uniform = 1e9;
  for (int across = 1; across <= 24; ++across) {
    const KnotVector v = KnotVector::clamped(5, cut_breaks(surface.v().breakpoints(), across));
    for (int along = 1; along <= 24; ++along) {
      const KnotVector u = KnotVector::clamped(5, cut_breaks(surface.u().breakpoints(), along));
      const double count = 1.0 * u.control_point_count() * v.control_point_count();
      if (count >= uniform) break;
      if (control_mesh_distance(refine(surface, u, v)) <= options.tolerance) uniform = count;
    }
  }
  state.counters["uniform"] = uniform;
}
BENCHMARK(control_mesh_of_a_bulge)->Arg(1)->Unit(benchmark::kMillisecond);

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
