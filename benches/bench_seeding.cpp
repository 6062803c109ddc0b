// From a centerline file to CAD, stage by stage, and how families of nasty trees fare.
//   bench_seeding sizes [LARGEST] [SUFFIXES]  combs of 1, 10, ... branches: seconds a stage, peak
//   memory bench_seeding families [EACH] [SEED] [NAME]   EACH trees of every family, one line a
//   family
// Wall seconds on all cores. Each row runs in a process of its own, so that its memory is its own.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <fmt/core.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "benches/tree_families.h"
#include "io/centerlines/centerline_export.h"
#include "io/centerlines/centerline_file.h"
#include "io/export/export_model.h"
#include "modeling/build/build_model.h"
#include "modeling/check/certificate.h"
#include "modeling/check/fidelity.h"

namespace {

using namespace angiospline;
namespace fs = std::filesystem;

class Clock {
 public:
  double lap() {
    const auto now = std::chrono::steady_clock::now();
    const double seconds = std::chrono::duration<double>(now - last_).count();
    last_ = now;
    return seconds;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

// The row's process; false if it failed or crashed.
bool apart(const std::function<int()>& row) {
  std::fflush(stdout);
  const pid_t child = fork();
  if (child == 0) {
    const int code = row();
    std::fflush(stdout);
    std::fflush(stderr);
    _exit(code);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

fs::path scratch() {
  const fs::path folder = fs::temp_directory_path() / fmt::format("bench_seeding_{}", getpid());
  fs::create_directories(folder);
  return folder;
}

int complain(const Error& error) {
  fmt::print(stderr, "{}\n", error.message());
  return 1;
}

// ---------------------------------------------------------------- sizes

int run_size(int branches, const std::vector<std::string>& suffixes) {
  const fs::path folder = scratch();
  const fs::path file = folder / "comb.swc";
  if (const auto written = write_centerline_file(file, comb_tree(branches)); !written) {
    return complain(written.error());
  }
  Clock clock;
  const auto tree = read_centerline_file(file);
  if (!tree) return complain(tree.error());
  std::string row = fmt::format("| {} | {:.3f} |", tree->branches.size(), clock.lap());
  const auto smoothed = smooth_centerlines(*tree);
  if (!smoothed) return complain(smoothed.error());
  row += fmt::format(" {:.3f} |", clock.lap());
  auto seeded = build_with_room(*smoothed);
  if (!seeded) return complain(seeded.error());
  Model* const model = &seeded->model;
  model->name = "comb";
  row += fmt::format(" {:.2f} |", clock.lap());
  const Fidelity fidelity = measure_fidelity(model->network, seeded->tree);
  row += fmt::format(" {:.2f} |", clock.lap());
  for (const std::string& suffix : suffixes) {
    if (const auto done = export_model(*model, {folder / ("comb" + suffix)}); !done) {
      return complain(done.error());
    }
    row += fmt::format(" {:.2f} |", clock.lap());
  }
  const auto certificate = certify(model->network, {});
  if (!certificate) return complain(certificate.error());
  row += fmt::format(" {:.2f} |", clock.lap());
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const double cpu = static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
                     1e-6 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
  fmt::print("{} {:.1f} | {} | {} | {} | {:.2g} | {:.2g} % / {:.2g} % |\n", row, cpu,
             usage.ru_maxrss / 1024, model->failed.size(),
             certificate->self_intersecting ? "crosses"
             : certificate->closed          ? "yes"
                                            : "open",
             certificate->max_normal_angle_deg, 100 * fidelity.mean_radius_error,
             100 * fidelity.largest_radius_error);
  fs::remove_all(folder);
  return 0;
}

int run_sizes(int largest, const std::vector<std::string>& suffixes) {
  std::string header = "| branches | read s | smooth s | model s | fidelity s |";
  for (const std::string& suffix : suffixes) header += fmt::format(" {} s |", suffix);
  fmt::print(
      "{} check s | CPU s | peak MiB | failed | sound | angle, degrees | radius off, mean / "
      "largest |\n",
      header);
  bool all = true;
  for (int branches = 1; branches <= largest; branches *= 10) {
    all = apart([&] { return run_size(branches, suffixes); }) && all;
  }
  return all ? 0 : 1;
}

// ---------------------------------------------------------------- families

struct Tally {
  int trees = 0;
  int refused = 0;
  int failed_parts = 0;
  int not_closed = 0;
  int crossing = 0;     // trees that cross where smoothing named no overlap
  int rough = 0;        // more than 0.01 degrees, or folded
  double off = 0;       // largest radius error away from junctions
  double mean_off = 0;  // largest mean of a tree
  double axis = 0;      // largest offset of the axis, radii
  std::string remarks;
};

bool names_overlap(const std::vector<Warning>& warnings) {
  return std::any_of(warnings.begin(), warnings.end(), [](const Warning& warning) {
    return warning.code == WarningCode::kVesselsOverlap ||
           warning.code == WarningCode::kClearanceMissing;
  });
}

void judge(const CenterlineTree& tree, int number, Tally& tally) {
  ++tally.trees;
  const auto remark = [&](const std::string& text) {
    tally.remarks += fmt::format("  [{}] {}\n", number, text);
  };
  const auto smoothed = smooth_centerlines(tree);
  const auto seeded =
      smoothed ? build_with_room(*smoothed) : Result<BuiltModel>(fail(smoothed.error()));
  if (!seeded) {
    ++tally.refused;
    remark(seeded.error().message());
    return;
  }
  const Model* const model = &seeded->model;
  for (const FailedPart& part : model->failed) {
    ++tally.failed_parts;
    remark(part.name + " failed: " + part.why);
  }
  const Fidelity f = measure_fidelity(model->network, seeded->tree);
  const auto solid = make_solid(model->network);
  const auto certificate = solid ? certify(*solid, {}) : Result<Certificate>(fail(solid.error()));
  if (!certificate) {
    ++tally.not_closed;
    remark(certificate.error().message());
    return;
  }
  const int components = component_count(smoothed->tree);
  const bool whole = certificate->closed && certificate->valid && certificate->solids == components;
  if (!whole) {
    ++tally.not_closed;
    remark(fmt::format("{} solids for {} components, closed {}, valid {}", certificate->solids,
                       components, certificate->closed, certificate->valid));
  }
  if (certificate->genus != cycle_count(smoothed->tree)) {
    remark(fmt::format("genus {} for {} loops", certificate->genus.value_or(-1),
                       cycle_count(smoothed->tree)));
  }
  if (certificate->max_normal_angle_deg > 0.01 || certificate->min_jacobian_ratio < 0.01) {
    ++tally.rough;
    remark(fmt::format("angle {:.2g} degrees, Jacobian ratio {:.2g}",
                       certificate->max_normal_angle_deg, certificate->min_jacobian_ratio));
  }
  if (certificate->self_intersecting) {
    const bool named = names_overlap(smoothed->warnings);
    if (!named) ++tally.crossing;
    remark(fmt::format("crosses itself{}", named ? ", as its vessels do" : ""));
  }
  tally.off = std::max(tally.off, f.largest_radius_error);
  tally.mean_off = std::max(tally.mean_off, f.mean_radius_error);
  tally.axis = std::max(tally.axis, f.largest_axis_offset);
  if (f.largest_radius_error > 0.05) {
    remark(fmt::format("radius {:.2g} % off in {} ({} of {} sections beyond 5 %)",
                       100 * f.largest_radius_error, f.largest_error_branch, f.far_off,
                       f.sections));
  }
  if (f.largest_axis_offset > 0.5) {
    remark(
        fmt::format("axis {:.2g} radii off in {}", f.largest_axis_offset, f.largest_offset_branch));
  }
  if (std::getenv("BENCH_SEEDING_WARNINGS") != nullptr) {
    for (const std::string& text : texts_of(model->warnings)) remark("warned: " + text);
  }
}

int run_family(const TreeFamily& family, int each, std::uint64_t seed) {
  Tally tally;
  Clock clock;
  for (int k = 0; k < each; ++k) {
    Random random(seed + 7919 * static_cast<std::uint64_t>(k));
    const CenterlineTree tree = family.make(random);
    if (const char* const folder = std::getenv("BENCH_SEEDING_KEEP")) {
      const auto kept = write_centerline_file(
          fs::path(folder) / fmt::format("{}_{}.graphml", family.name, k), tree);
      if (!kept) return complain(kept.error());
    }
    judge(tree, k, tally);
  }
  fmt::print("| {} | {} | {} | {} | {} | {} | {} | {:.2g} % | {:.2g} % | {:.2g} | {:.1f} |\n{}",
             family.name, tally.trees, tally.refused, tally.failed_parts, tally.not_closed,
             tally.rough, tally.crossing, 100 * tally.mean_off, 100 * tally.off, tally.axis,
             clock.lap(), tally.remarks);
  return tally.refused + tally.failed_parts + tally.not_closed + tally.rough + tally.crossing == 0
             ? 0
             : 1;
}

int run_families(int each, std::uint64_t seed, const std::string& only) {
  fmt::print(
      "| family | trees | refused | failed parts | not one solid | rough | crossing | radius "
      "off, mean | largest | axis off, radii | s |\n");
  bool all = true;
  for (const TreeFamily& family : tree_families()) {
    if (!only.empty() && family.name != only) continue;
    const bool ended = apart([&] { return run_family(family, each, seed); });
    all = ended && all;
  }
  return all ? 0 : 1;
}

std::vector<std::string> parts(const std::string& text) {
  std::vector<std::string> list;
  std::size_t from = 0;
  while (from < text.size()) {
    const std::size_t comma = std::min(text.find(',', from), text.size());
    list.push_back(fmt::format(".{}", text.substr(from, comma - from)));
    from = comma + 1;
  }
  return list;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "";
  if (what.empty()) return run_sizes(1000, parts("step,iges,glb")) + run_families(1, 1, "");
  if (what == "sizes") {
    return run_sizes(argc > 2 ? std::atoi(argv[2]) : 10000,
                     parts(argc > 3 ? argv[3] : "step,iges,glb"));
  }
  if (what == "families") {
    return run_families(argc > 2 ? std::atoi(argv[2]) : 5,
                        argc > 3 ? std::strtoull(argv[3], nullptr, 10) : 1,
                        argc > 4 ? argv[4] : "");
  }
  fmt::print(stderr, "bench_seeding sizes [LARGEST] [SUFFIXES] | families [EACH] [SEED] [NAME]\n");
  return 2;
}
