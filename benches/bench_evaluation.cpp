#include <thread>
#include <vector>

#include "benches/kernel_samples.h"
#include "benches/sisl_peer.h"
#include <GeomAdaptor_Surface.hxx>
#include <benchmark/benchmark.h>
#include <gp_Vec.hxx>

#include "kernel/evaluator.h"
#include "kernel/grid.h"
#include "modeling/occt_bspline.h"

namespace angiospline::bench {
namespace {

Eigen::Matrix2Xd parameters(const benchmark::State& state) {
  return state.range(0) == 0 ? grid_parameters() : shuffled(grid_parameters());
}

void count_points(benchmark::State& state, Eigen::Index points) {
  state.SetItemsProcessed(state.iterations() * points);
}

// Argument 0: grid order, 1: shuffled.
void point_and_partials(benchmark::State& state) {
  const Eigen::Matrix2Xd uv = parameters(state);
  const SurfaceEvaluator<3> surface(sheet());
  for (auto _ : state) {
    for (Eigen::Index k = 0; k < uv.cols(); ++k) {
      benchmark::DoNotOptimize(surface.partials(uv(0, k), uv(1, k)));
    }
  }
  count_points(state, uv.cols());
}
BENCHMARK(point_and_partials)->Arg(0)->Arg(1);

void point_and_partials_batch(benchmark::State& state) {
  const Eigen::Matrix2Xd uv = parameters(state);
  const SurfaceEvaluator<3> surface(sheet());
  std::vector<SurfacePartials<3>> out(static_cast<std::size_t>(uv.cols()));
  for (auto _ : state) {
    surface.evaluate_all(uv, out.data());
    benchmark::ClobberMemory();
  }
  count_points(state, uv.cols());
}
BENCHMARK(point_and_partials_batch)->Arg(0)->Arg(1);

void point_and_partials_occt(benchmark::State& state) {
  const Eigen::Matrix2Xd uv = parameters(state);
  const GeomAdaptor_Surface surface(to_occt(sheet()));
  gp_Pnt point;
  gp_Vec by_u;
  gp_Vec by_v;
  for (auto _ : state) {
    for (Eigen::Index k = 0; k < uv.cols(); ++k) {
      surface.D1(uv(0, k), uv(1, k), point, by_u, by_v);
      benchmark::DoNotOptimize(by_v);
    }
  }
  count_points(state, uv.cols());
}
BENCHMARK(point_and_partials_occt)->Arg(0)->Arg(1);

void grid_with_partials(benchmark::State& state) {
  const BSplineSurface<3> surface = sheet();
  const auto t = spaced(0, 1, 200);
  SurfaceGrid<3> grid;
  for (auto _ : state) {
    grid = evaluate_grid(surface, t, t, 1, std::move(grid));
    benchmark::DoNotOptimize(grid.points().data());
  }
  count_points(state, 40000);
}
BENCHMARK(grid_with_partials);

// 10^7 points; argument: threads.
void ten_million_points(benchmark::State& state) {
  const SurfaceEvaluator<3> surface(sheet());
  const Eigen::Matrix2Xd uv = grid_parameters().replicate(1, 250);
  std::vector<SurfacePartials<3>> out(static_cast<std::size_t>(uv.cols()));
  for (auto _ : state) {
    surface.evaluate_all(uv, out.data(), static_cast<int>(state.range(0)));
    benchmark::ClobberMemory();
  }
  count_points(state, uv.cols());
}
BENCHMARK(ten_million_points)->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);

// The cost of preparing grows linearly: n, 10 n, 100 n control points.
void prepare_evaluator(benchmark::State& state) {
  const BSplineSurface<3> surface = tube(static_cast<int>(state.range(0)), 12);
  for (auto _ : state) benchmark::DoNotOptimize(SurfaceEvaluator<3>(surface));
}
BENCHMARK(prepare_evaluator)->Arg(100)->Arg(1000)->Arg(10000)->Unit(benchmark::kMicrosecond);

#ifdef ANGIOSPLINE_HAS_SISL
void point_and_partials_sisl(benchmark::State& state) {
  const Eigen::Matrix2Xd uv = parameters(state);
  const SislSurface surface = to_sisl(sheet());
  int left_u = 0;
  int left_v = 0;
  int status = 0;
  double derivatives[9];
  double normal[3];
  for (auto _ : state) {
    for (Eigen::Index k = 0; k < uv.cols(); ++k) {
      double at[2] = {uv(0, k), uv(1, k)};
      s1421(surface.get(), 1, at, &left_u, &left_v, derivatives, normal, &status);
      benchmark::DoNotOptimize(derivatives);
    }
  }
  count_points(state, uv.cols());
}
BENCHMARK(point_and_partials_sisl)->Arg(0)->Arg(1);

void grid_with_partials_sisl(benchmark::State& state) {
  const SislSurface surface = to_sisl(sheet());
  std::vector<double> t = spaced(0, 1, 200);
  std::vector<double> derivatives(9 * 40000);
  std::vector<double> normals(3 * 40000);
  int status = 0;
  for (auto _ : state) {
    s1506(surface.get(), 1, 200, t.data(), 200, t.data(), derivatives.data(), normals.data(),
          &status);
    benchmark::ClobberMemory();
  }
  count_points(state, 40000);
}
BENCHMARK(grid_with_partials_sisl);
#endif

}  // namespace
}  // namespace angiospline::bench
