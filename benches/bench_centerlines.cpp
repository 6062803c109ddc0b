// Reading and smoothing centerlines: one line a file of ANGIOSPLINE_DATA, and made-up trees of up
// to 10,000 branches. Counters: branches, control points, the largest move in mm, warnings.
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>

#include <benchmark/benchmark.h>

#include "base/random.h"
#include "io/centerlines/centerline_file.h"
#include "modeling/tree/overlaps.h"
#include "modeling/tree/point_graph.h"
#include "modeling/tree/smooth_centerlines.h"

namespace angiospline {
namespace {

void count(benchmark::State& state, const SmoothedTree& smooth) {
  int control_points = 0;
  for (const auto& path : smooth.paths) control_points += path.knots().control_point_count();
  state.counters["branches"] = static_cast<double>(smooth.paths.size());
  state.counters["control_points"] = control_points;
  state.counters["largest_move_mm"] = smooth.largest_move_mm;
  state.counters["warnings"] = static_cast<double>(smooth.warnings.size());
}

void read_file_of(benchmark::State& state, const std::filesystem::path& path) {
  for (auto _ : state) benchmark::DoNotOptimize(read_centerline_file(path));
}

void smooth_file(benchmark::State& state, const std::filesystem::path& path) {
  const auto tree = read_centerline_file(path);
  if (!tree) {
    state.SkipWithError(tree.error().message().c_str());
    return;
  }
  for (auto _ : state) {
    const auto smooth = smooth_centerlines(*tree);
    if (smooth) count(state, *smooth);
  }
}

// Binary branching, twelve noisy points a branch, radii after Murray, each level in its own
// direction.
CenterlineTree made_up_tree(int branches) {
  PointGraph graph;
  Random random(1);
  struct Tip {
    int point;
    Vec3 direction;
    double radius;
  };
  graph.points.push_back({"0", Vec3::Zero(), 8.0});
  graph.roots = {0};
  std::vector<Tip> tips = {{0, Vec3::UnitZ(), 8.0}};
  for (int b = 0; b < branches; ++b) {
    const Tip tip = tips[static_cast<std::size_t>(b)];
    int before = tip.point;
    Vec3 p = graph.points[static_cast<std::size_t>(before)].position_mm;
    for (int i = 0; i < 12; ++i) {
      p += tip.radius * tip.direction;
      const Vec3 noise(random.gaussian(), random.gaussian(), random.gaussian());
      const int here = static_cast<int>(graph.points.size());
      graph.points.push_back({std::to_string(here), p + 0.1 * tip.radius * noise, tip.radius});
      graph.edges.emplace_back(before, here);
      before = here;
    }
    for (const double side : {-1.0, 1.0}) {
      const Vec3 turn(random.gaussian(), random.gaussian(), random.gaussian());
      tips.push_back({before, (tip.direction + side * 0.7 * turn.normalized()).normalized(),
                      0.794 * tip.radius});
    }
  }
  return *tree_from_points(graph);
}

void smooth_made_up(benchmark::State& state) {
  const CenterlineTree tree = made_up_tree(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    const auto smooth = smooth_centerlines(tree);
    if (smooth) count(state, *smooth);
  }
}
BENCHMARK(smooth_made_up)
    ->RangeMultiplier(10)
    ->Range(1, 10000)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();

}  // namespace
}  // namespace angiospline

int main(int argc, char** argv) {
  using namespace angiospline;
  if (const char* const data = std::getenv("ANGIOSPLINE_DATA")) {
    for (const char* name :
         {"example_centerline_ICA.swc", "BH0005.swc", "BG07.swc", "aorta-centerline.vtp",
          "carotid_left_centerline.vtp", "vascusynth_N200_tree_structure.xml", "vesselvio"}) {
      const auto path = std::filesystem::path(data) / "centerlines" / name;
      benchmark::RegisterBenchmark((std::string("read/") + name).c_str(), read_file_of, path)
          ->Unit(benchmark::kMillisecond)
          ->MeasureProcessCPUTime();
      benchmark::RegisterBenchmark((std::string("smooth/") + name).c_str(), smooth_file, path)
          ->Unit(benchmark::kMillisecond)
          ->MeasureProcessCPUTime();
    }
  }
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
