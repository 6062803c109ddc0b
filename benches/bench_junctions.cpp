// Sweeps random junctions of every class: success, fairness and seconds, one line a class.
// Seconds are of CPU time, one thread, template and smoothing and gates.
// bench_junctions [COUNT [SEED [CLASS [DUMP_DIRECTORY]]]]
#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <string>

#include "junction_classes.h"
#include <fmt/core.h>

#include "modeling/junction.h"

namespace {

using namespace angiospline;

// Plain text for a plotting script: one patch a block of 36 points, rows along u.
void dump(const std::string& path, const Junction& junction) {
  std::ofstream out(path);
  for (const Patch& patch : junction.network.patches) {
    for (const int c : patch.control) {
      const Vec3 p = junction.network.control_points_mm.col(c);
      out << fmt::format("{} {} {}\n", p.x(), p.y(), p.z());
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  const int count = argc > 1 ? std::atoi(argv[1]) : 20;
  const std::uint64_t seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  const std::string only = argc > 3 ? argv[3] : "";
  const std::string directory = argc > 4 ? argv[4] : "";
  fmt::print("{:12} {:>5} {:>5} {:>5} {:>6} {:>9} {:>7} {:>8} {:>8} {:>7}\n", "class", "count",
             "ok", "fair", "first", "angle", "jacob", "curv med", "curv max", "s");
  for (const JunctionClass& family : junction_classes()) {
    if (!only.empty() && only != "all" && family.name != only) continue;
    Random random(seed);
    int ok = 0, fair = 0, first = 0;
    double angle = 0, jacobian = 1, seconds = 0;
    std::vector<double> curvature;
    for (int k = 0; k < count; ++k) {
      const JunctionSpec spec = family.make(random);
      const std::clock_t start = std::clock();
      const Result<Junction> junction = make_junction(spec);
      seconds += static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
      if (!junction) {
        fmt::print(stderr, "{} {}: {}\n", family.name, k, junction.error().message());
        continue;
      }
      ++ok;
      first += junction->attempts == 1;
      fair += junction->fair;
      angle = std::max(angle, junction->worst_angle_deg);
      jacobian = std::min(jacobian, junction->jacobian_ratio);
      curvature.push_back(junction->curvature_times_radius);
      if (!directory.empty())
        dump(fmt::format("{}/{}_{}.txt", directory, family.name, k), *junction);
    }
    std::sort(curvature.begin(), curvature.end());
    fmt::print("{:12} {:5} {:5} {:5} {:6} {:9.1e} {:7.3f} {:8.2f} {:8.2f} {:7.3f}\n", family.name,
               count, ok, fair, first, angle, jacobian,
               curvature.empty() ? 0 : curvature[curvature.size() / 2],
               curvature.empty() ? 0 : curvature.back(), seconds / count);
    std::fflush(stdout);
  }
}
