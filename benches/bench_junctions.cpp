// Sweeps random junctions of every class: success, fairness and seconds, one line a class and one
// for all; then how long template and smoothing take. Seconds are of CPU time, one thread. What is
// not sound or not fair is named on stderr with its failure. CLASS: a class, "hard" (all but the
// ordinary ones) or "all".
// bench_junctions [COUNT [SEED [CLASS [DUMP_DIRECTORY]]]]
#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <numbers>
#include <string>

#include <fmt/core.h>

#include "benches/junction_classes.h"
#include "modeling/junction/junction.h"
#include "modeling/layout/layout.h"
#include "modeling/junction/plan_openings.h"
#include "modeling/junction/smooth_junction.h"

namespace {

using namespace angiospline;

double seconds_now() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

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

// What a sweep found.
struct Tally {
  int count = 0;
  int ok = 0;
  int fair = 0;
  int gentle = 0;  // fair, and curvature times smallest radius at most kGentle
  int first = 0;   // done by the first setting
  double angle = 0;
  double jacobian = 1;
  double distance = 0;
  double moved = 0;
  double seconds = 0;
  std::vector<double> curvature;
};
constexpr double kGentle = 8;

void add(Tally& all, const Tally& part) {
  all.count += part.count;
  all.ok += part.ok;
  all.fair += part.fair;
  all.gentle += part.gentle;
  all.first += part.first;
  all.angle = std::max(all.angle, part.angle);
  all.jacobian = std::min(all.jacobian, part.jacobian);
  all.distance = std::max(all.distance, part.distance);
  all.moved = std::max(all.moved, part.moved);
  all.seconds += part.seconds;
  all.curvature.insert(all.curvature.end(), part.curvature.begin(), part.curvature.end());
}

void print_row(const std::string& name, Tally tally) {
  std::vector<double>& curvature = tally.curvature;
  std::sort(curvature.begin(), curvature.end());
  fmt::print(
      "{:12} {:5} {:5} {:5} {:6} {:5} {:9.1e} {:7.3f} {:8.2f} {:8.2f} {:7.3f} {:6.3f} {:7.3f}\n",
      name, tally.count, tally.ok, tally.fair, tally.gentle, tally.first, tally.angle,
      tally.jacobian, curvature.empty() ? 0 : curvature[curvature.size() / 2],
      curvature.empty() ? 0 : curvature.back(), tally.distance, tally.moved,
      tally.seconds / tally.count);
  std::fflush(stdout);
}

Tally sweep(const JunctionClass& family, int count, std::uint64_t seed,
            const std::string& directory) {
  Random random(seed);
  Tally tally;
  tally.count = count;
  for (int k = 0; k < count; ++k) {
    const JunctionSpec spec = family.make(random);
    const double start = seconds_now();
    const Result<Junction> junction = make_junction(spec);
    tally.seconds += seconds_now() - start;
    if (!junction) {
      fmt::print(stderr, "{} {}: {}\n", family.name, k, junction.error().message());
      continue;
    }
    ++tally.ok;
    tally.first += junction->attempts == 1;
    tally.fair += junction->fair;
    tally.gentle += junction->fair && junction->curvature_times_radius <= kGentle;
    tally.angle = std::max(tally.angle, junction->worst_angle_deg);
    tally.jacobian = std::min(tally.jacobian, junction->jacobian_ratio);
    tally.distance = std::max(tally.distance, junction->distance_over_radius);
    tally.moved = std::max(tally.moved, junction->moved_over_radius);
    tally.curvature.push_back(junction->curvature_times_radius);
    if (!junction->fair) {
      fmt::print(stderr, "{} {}: not fair: curvature {:.3g}, distance {:.3g}\n", family.name, k,
                 junction->curvature_times_radius, junction->distance_over_radius);
    }
    if (!directory.empty()) dump(fmt::format("{}/{}_{}.txt", directory, family.name, k), *junction);
  }
  return tally;
}

// Openings, target, topology and layout; and the solve: the first setting's, as make_junction runs
// them.
void time_stages(const JunctionClass& family, int count, std::uint64_t seed) {
  Random random(seed);
  double layout_seconds = 0, smooth_seconds = 0;
  for (int k = 0; k < count; ++k) {
    const JunctionSpec spec = family.make(random);
    const double start = seconds_now();
    const auto plan = plan_openings(spec, {});
    if (!plan) continue;
    const JunctionTopology topology =
        junction_topology(plan->directions(), 5 * std::numbers::pi / 180);
    const JunctionTarget target(plan->branches, plan->blend, plan->rounding);
    const JunctionLayout layout = relaxed_layout(topology, target, plan->distances);
    const double middle = seconds_now();
    const SmoothedNet smooth = smooth_junction(topology, target, layout);
    smooth_seconds += seconds_now() - middle;
    layout_seconds += middle - start;
    if (!smooth.solved) fmt::print(stderr, "{} {}: not solved\n", family.name, k);
  }
  fmt::print("{}: template {:.4f} s, smoothing {:.4f} s, together {:.4f} s\n", family.name,
             layout_seconds / count, smooth_seconds / count,
             (layout_seconds + smooth_seconds) / count);
}

}  // namespace

int main(int argc, char** argv) {
  const int count = argc > 1 ? std::atoi(argv[1]) : 20;
  const std::uint64_t seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  const std::string only = argc > 3 ? argv[3] : "";
  const std::string directory = argc > 4 ? argv[4] : "";
  const auto wanted = [&](const JunctionClass& family) {
    return only.empty() || only == "all" || family.name == only ||
           (only == "hard" && family.name != "ordinary");
  };
  fmt::print("{:12} {:>5} {:>5} {:>5} {:>6} {:>5} {:>9} {:>7} {:>8} {:>8} {:>7} {:>6} {:>7}\n",
             "class", "count", "ok", "fair", "gentle", "first", "angle", "jacob", "curv med",
             "curv max", "dist", "moved", "s");
  Tally all;
  for (const JunctionClass& family : junction_classes()) {
    if (!wanted(family)) continue;
    const Tally tally = sweep(family, count, seed, directory);
    print_row(family.name, tally);
    add(all, tally);
  }
  if (all.count > count) print_row("all", all);
  for (const JunctionClass& family : junction_classes()) {
    if (wanted(family)) time_stages(family, std::min(count, 20), seed);
  }
}
