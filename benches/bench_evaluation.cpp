#include <algorithm>
#include <array>
#include <chrono>
#include <ctime>
#include <vector>

#include <GeomAdaptor_Surface.hxx>
#include <benchmark/benchmark.h>
#include <gp_Vec.hxx>

#include "benches/kernel_samples.h"
#include "benches/sisl_peer.h"
#include "kernel/evaluate/grid.h"
#include "kernel/spline/evaluator.h"
#include "modeling/solid/occt_bspline.h"

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

// All that SISL's s1506 gives: unit normals too.
void grid_with_partials_and_normals(benchmark::State& state) {
  const BSplineSurface<3> surface = sheet();
  const auto t = spaced(0, 1, 200);
  SurfaceGrid<3> grid;
  Eigen::Matrix3Xd normals;
  for (auto _ : state) {
    grid = evaluate_grid(surface, t, t, 1, std::move(grid));
    normals = unit_normals(grid, std::move(normals));
    benchmark::DoNotOptimize(normals.data());
  }
  count_points(state, 40000);
}
BENCHMARK(grid_with_partials_and_normals);

double cpu_seconds(clockid_t clock) {
  timespec t;
  clock_gettime(clock, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

struct Timing {
  double wall = 1e9;
  double cpu = 1e9;  // of the thread that worked longest: wall time where nothing else runs
};

// One batch on `threads` threads, at most two.
Timing timed_batch(const SurfaceEvaluator<3>& surface, const Eigen::Matrix2Xd& uv, int threads,
                   std::vector<SurfacePartials<3>>& out) {
  const auto start = std::chrono::steady_clock::now();
  const double own_start = cpu_seconds(CLOCK_THREAD_CPUTIME_ID);
  const double all_start = cpu_seconds(CLOCK_PROCESS_CPUTIME_ID);
  surface.evaluate_all(uv, out.data(), threads);
  benchmark::ClobberMemory();
  const double all = cpu_seconds(CLOCK_PROCESS_CPUTIME_ID) - all_start;
  const double own = cpu_seconds(CLOCK_THREAD_CPUTIME_ID) - own_start;
  const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - start;
  return {wall.count(), std::max(own, all - own)};
}

// 10^7 points on one thread and on two. Other programs take their turns on a machine that is not
// idle, so the points are worked through in slices of a few milliseconds, one thread and two in
// turn, and the best of several tries counts for each slice, the start of the threads included. On
// a busy machine only the CPU times say something.
void ten_million_points(benchmark::State& state) {
  constexpr int kSlices = 50;
  constexpr int kTries = 5;
  const SurfaceEvaluator<3> surface(sheet());
  const Eigen::Matrix2Xd uv = grid_parameters().replicate(1, 5);
  std::vector<SurfacePartials<3>> out(static_cast<std::size_t>(uv.cols()));
  Timing one{0, 0};
  Timing two{0, 0};
  for (auto _ : state) {
    for (int slice = 0; slice < kSlices; ++slice) {
      std::array<Timing, 2> best;
      for (int k = 0; k < 2 * kTries; ++k) {
        const Timing t = timed_batch(surface, uv, 1 + k % 2, out);
        Timing& least = best[static_cast<std::size_t>(k % 2)];
        least = {std::min(least.wall, t.wall), std::min(least.cpu, t.cpu)};
      }
      one = {one.wall + best[0].wall, one.cpu + best[0].cpu};
      two = {two.wall + best[1].wall, two.cpu + best[1].cpu};
    }
  }
  state.counters["one_wall_ms"] = 1e3 * one.wall;
  state.counters["two_wall_ms"] = 1e3 * two.wall;
  state.counters["wall_ratio"] = one.wall / two.wall;
  state.counters["cpu_ratio"] = one.cpu / two.cpu;
}
BENCHMARK(ten_million_points)->Iterations(1)->Unit(benchmark::kMillisecond);

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

// Ours and SISL's in turn. Argument 1: with unit normals, which s1506 always gives.
void grid_in_turn(benchmark::State& state) {
  const BSplineSurface<3> surface = sheet();
  const SislSurface peer = to_sisl(surface);
  std::vector<double> t = spaced(0, 1, 200);
  std::vector<double> derivatives(9 * 40000);
  std::vector<double> peer_normals(3 * 40000);
  SurfaceGrid<3> grid;
  Eigen::Matrix3Xd normals;
  double ratio = 0;
  for (auto _ : state) {
    ratio = ratio_in_turn(
        [&] {
          grid = evaluate_grid(surface, t, t, 1, std::move(grid));
          if (state.range(0) != 0) normals = unit_normals(grid, std::move(normals));
          benchmark::ClobberMemory();
        },
        [&] {
          int status = 0;
          s1506(peer.get(), 1, 200, t.data(), 200, t.data(), derivatives.data(),
                peer_normals.data(), &status);
          benchmark::ClobberMemory();
        });
  }
  state.counters["ratio"] = ratio;
}
BENCHMARK(grid_in_turn)->Arg(0)->Arg(1)->Iterations(1);
#endif

}  // namespace
}  // namespace angiospline::bench
