// From mask to centerlines: time and memory of thinning beside scikit-image, and how right the
// trees are.
//   bench_skeleton [thinning] [trees] [tubes] [large]      without arguments: the first three
// Times are CPU seconds of one thread. The peer runs on the same masks through skeleton_peer.py, if
// /usr/bin/python3 has scikit-image (apt install python3-skimage); otherwise its column stays
// empty.
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>

#include <fmt/format.h>
#include <tbb/global_control.h>

#include "recovery/centerlines/vessels_from_mask.h"
#include "recovery/imaging/image/gaussian.h"
#include "recovery/imaging/mask/morphology.h"
#include "tests/shapes/random_trees.h"
#include "tests/shapes/tree_match.h"

namespace angiospline {
namespace {

double cpu_seconds() {
  std::timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

// A line of /proc/self/status in MB: VmRSS now, VmHWM at its highest since the last reset.
double memory_mb(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.rfind(key, 0) == 0)
      return std::strtod(line.c_str() + key.size() + 1, nullptr) / 1024.0;
  return 0.0;
}
void reset_peak() { std::ofstream("/proc/self/clear_refs") << "5"; }

struct Measured {
  double seconds = 0.0;
  double more_mb = 0.0;  // beyond what was there before
};

template <typename Work>
Measured measured(const Work& work) {
  reset_peak();
  const double before = memory_mb("VmRSS");
  const double start = cpu_seconds();
  work();
  return {cpu_seconds() - start, memory_mb("VmHWM") - before};
}

// The peer's own line: seconds, memory, voxels left.
std::string peer(const Mask& mask) {
  const std::filesystem::path file = std::filesystem::temp_directory_path() / "bench_skeleton.raw";
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(mask.voxels.data()),
             static_cast<std::streamsize>(mask.voxels.size()));
  const std::string command = fmt::format(
      "OMP_NUM_THREADS=1 /usr/bin/python3 {}/benches/skeleton_peer.py {} {} {} {} 2>/dev/null",
      ANGIOSPLINE_SOURCE_DIR, file.string(), mask.grid.size[0], mask.grid.size[1],
      mask.grid.size[2]);
  std::string answer;
  if (std::FILE* pipe = popen(command.c_str(), "r")) {
    char line[200];
    while (std::fgets(line, sizeof line, pipe)) answer += line;
    pclose(pipe);
  }
  std::filesystem::remove(file);
  return answer.empty() ? "no scikit-image\n" : answer;
}

CenterlineTree grown(double extent, double root, double least, int branches, std::uint64_t seed) {
  test::RandomTreeOptions options;
  options.extent_mm = extent;
  options.root_radius_mm = root;
  options.least_radius_mm = least;
  options.most_branches = branches;
  Random random(seed);
  return test::RandomTree(options, random).grow();
}

void thinning_row(const std::string& name, const Mask& mask, bool with_peer) {
  const TopologyNumbers before = topology_numbers(mask);
  for (const ThinningOrder order : {ThinningOrder::kSubfields, ThinningOrder::kDistance}) {
    Mask axis = mask;
    const Measured m = measured([&] {
      axis = thin(std::move(axis), {Connectivity::k26, order}).value();
    });
    const TopologyNumbers after = topology_numbers(axis);
    fmt::print("{:<10} {:<9} {:9.3f} s {:+7.1f} MB  {:8} -> {:6} voxels, topology {}\n", name,
               order == ThinningOrder::kSubfields ? "subfields" : "distance", m.seconds, m.more_mb,
               foreground_offsets(mask).size(), foreground_offsets(axis).size(),
               before == after ? "kept" : "CHANGED");
  }
  if (with_peer) fmt::print("{:<10} skimage   {}", name, peer(mask));
}

// What becomes of the mask of a known tree.
void quality_row(const std::string& name, const Mask& mask, const CenterlineTree& truth) {
  Vessels v;
  const Measured m = measured([&] { v = vessels_from_mask(mask).value(); });
  const test::TreeMatch match = test::match(truth, v.tree);
  const test::CenterlineErrors e = test::centerline_errors(truth, v.tree);
  const auto row = [](const test::Match& found) {
    return fmt::format("{} of {} ({} found)", found.paired, found.truth, found.found);
  };
  fmt::print(
      "{:<10} tree {:.2f} s: ends {}, junctions {}, branches {}; off centre mean {:.3f} worst "
      "{:.2f} "
      "voxel, radius bias {:+.1f} %, tips lost at most {:.1f} voxel\n",
      name, m.seconds, row(match.ends), row(match.junctions), row(match.branches), e.mean_mm,
      e.worst_mm, 100.0 * e.radius_bias, match.worst_tip_lost_mm);
}

void thinning() {
  const CenterlineTree tree = grown(512, 12, 3, 61, 4);
  Mask mask = test::empty_mask({512, 512, 512});
  test::paint(mask, tree);
  thinning_row(fmt::format("tree {}", tree.branches.size()), mask, true);
  quality_row("tree", mask, tree);
  Mask ring = test::empty_mask({96, 96, 24});
  for (int k = 0; k < 720; ++k) {
    const double a = k * std::numbers::pi / 360;
    const Vec3 p(48 + 30 * std::cos(a), 48 + 30 * std::sin(a), 12);
    test::add_tube(ring, p, p, 5);
  }
  const Vessels loop = vessels_from_mask(ring).value();
  fmt::print("pure ring  {} branch, {} cycle\n", loop.tree.branches.size(), cycle_count(loop.tree));
  thinning_row("rings 256", test::rings_mask(256, 95, 8), true);
  Random random(3);
  Image<float> noise(test::empty_mask({256, 256, 256}).grid);
  for (float& v : noise.voxels) v = static_cast<float>(random.gaussian());
  noise = smoothed(std::move(noise), 4.0);
  Mask blob(noise.grid);
  for (std::size_t i = 0; i < blob.voxels.size(); ++i)
    blob.voxels[i] = noise.voxels[i] > 0.0F ? 1 : 0;
  thinning_row("blob 256", blob, true);
  Mask bar = test::empty_mask({10, 10, 104});
  for (int z = 2; z < 102; ++z)
    for (int y = 3; y < 7; ++y)
      for (int x = 3; x < 7; ++x) bar[{x, y, z}] = 1;
  thinning_row("bar 4x4", bar, true);
}

// The mask of a tree, or of its image with noise: smoothed, cut at half, solid, one component.
Mask observed(const CenterlineTree& tree, double snr, Random& random) {
  Mask mask = test::empty_mask({120, 120, 120});
  test::paint(mask, tree);
  if (snr == 0.0) return mask;
  Image<float> image(mask.grid);
  for (std::size_t i = 0; i < mask.voxels.size(); ++i)
    image.voxels[i] = static_cast<float>(mask.voxels[i] + random.gaussian() / snr);
  image = smoothed(std::move(image), 0.8);
  for (std::size_t i = 0; i < mask.voxels.size(); ++i)
    mask.voxels[i] = image.voxels[i] >= 0.5F ? 1 : 0;
  return largest_component(fill_cavities(mask).mask);
}

void trees() {
  for (const double snr : {0.0, 8.0, 4.0, 2.0}) {
    test::Match ends;
    test::Match junctions;
    test::Match branches;
    double offset = 0.0;
    double worst = 0.0;
    double bias = 0.0;
    double lost = 0.0;
    int points = 0;
    std::size_t contacts = 0;
    for (std::uint64_t seed = 0; seed < 50; ++seed) {
      const CenterlineTree truth = grown(120, 6, 1.5, 31, seed);
      Random random(seed + 100);
      const Vessels v = vessels_from_mask(observed(truth, snr, random)).value();
      const test::TreeMatch m = test::match(truth, v.tree);
      const test::CenterlineErrors e = test::centerline_errors(truth, v.tree);
      ends += m.ends;
      junctions += m.junctions;
      branches += m.branches;
      contacts += v.contacts.size();
      offset += e.mean_mm * e.points;
      bias += e.radius_bias * e.points;
      points += e.points;
      worst = std::max(worst, e.worst_mm);
      lost = std::max(lost, m.worst_tip_lost_mm);
    }
    fmt::print(
        "50 trees, SNR {:>4}: F1 ends {:.3f} junctions {:.3f} branches {:.3f} of {}; off centre "
        "mean {:.3f} worst {:.2f} voxel, radius bias {:+.1f} %, tips lost at most {:.1f} voxel; {} "
        "contacts\n",
        snr == 0.0 ? "none" : fmt::format("{}", snr), ends.f1(), junctions.f1(), branches.f1(),
        branches.truth, offset / points, worst, 100.0 * bias / points, lost, contacts);
  }
}

// How far points lie off an axis, in voxels of the image (each coordinate in its own spacing).
struct OffAxis {
  double sum = 0.0;
  double worst = 0.0;
  double worst_at_tips = 0.0;  // within a radius of either end
  int points = 0;
};

// Flat-ended tubes of length 54 in random directions; with slices of 3 mm the radii are at least 3.
void tubes_row(double slice_mm, double radius) {
  Random random(11);
  OffAxis off;
  double width = 0.0;
  double length = 0.0;
  constexpr int kTubes = 20;
  for (int i = 0; i < kTubes; ++i) {
    const Vec3 axis = Vec3(random.gaussian(), random.gaussian(), random.gaussian()).normalized();
    const Vec3 center(45.0 + random.uniform(), 45.0 + random.uniform(), 45.0 + random.uniform());
    Mask mask = test::empty_mask({92, 92, static_cast<int>(92 / slice_mm)}, Vec3(1, 1, slice_mm));
    test::add_tube(mask, center - 27.0 * axis, center + 27.0 * axis, radius, test::Ends::kFlat);
    const CenterlineTree tree = vessels_from_mask(mask).value().tree;
    for (const CenterlineBranch& b : tree.branches) {
      length += length_mm(b) / kTubes;
      for (Eigen::Index k = 0; k < b.points_mm.cols(); ++k) {
        const Vec3 d = b.points_mm.col(k) - center;
        const Vec3 across = d - d.dot(axis) * axis;
        const double vox = across.cwiseQuotient(mask.grid.spacing_mm).norm();
        double& worst = std::abs(d.dot(axis)) > 27.0 - radius ? off.worst_at_tips : off.worst;
        off.sum += vox;
        worst = std::max(worst, vox);
        width += b.radii_mm[k] / radius;
        ++off.points;
      }
    }
  }
  fmt::print(
      "tubes 1:1:{} radius {:>4} mm: off centre mean {:.3f} worst {:.2f}, at tips {:.2f} voxel, "
      "radius bias {:+.1f} %, length {:.1f} of 54\n",
      slice_mm, radius, off.sum / off.points, off.worst, off.worst_at_tips,
      100.0 * (width / off.points - 1.0), length);
}

void tubes() {
  for (const double slice_mm : {1.0, 3.0})
    for (const double radius : {1.5, 2.0, 3.0, 5.0, 8.0, 12.0})
      if (radius >= slice_mm) tubes_row(slice_mm, radius);
}

void large() {
  const CenterlineTree tree = grown(1024, 30, 4, 121, 4);
  Mask mask = test::empty_mask({1024, 1024, 1024});
  test::paint(mask, tree);
  const std::size_t voxels = foreground_offsets(mask).size();
  Mask axis;
  const Measured copy = measured([&] { axis = mask; });
  const Measured m = measured([&] { axis = thin(std::move(axis)).value(); });
  fmt::print(
      "1024^3, {} branches, {} voxels: thin {:.2f} s {:+.1f} MB beyond the result ({:.2f} s to "
      "copy)\n",
      tree.branches.size(), voxels, m.seconds, m.more_mb, copy.seconds);
  axis = {};
  Vessels v;
  const Measured all = measured([&] { v = vessels_from_mask(mask).value(); });
  const test::TreeMatch match = test::match(tree, v.tree);
  fmt::print(
      "1024^3, mask to tree: {:.2f} s {:+.0f} MB beyond the mask; branches {} of {} matched, {} "
      "found\n",
      all.seconds, all.more_mb, match.branches.paired, match.branches.truth, match.branches.found);
}

}  // namespace
}  // namespace angiospline

int main(int argc, char** argv) {
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const auto asked = [&](const std::string& name) {
    for (int i = 1; i < argc; ++i)
      if (argv[i] == name) return true;
    return argc == 1 && name != "large";
  };
  if (asked("thinning")) angiospline::thinning();
  if (asked("trees")) angiospline::trees();
  if (asked("tubes")) angiospline::tubes();
  if (asked("large")) angiospline::large();
}
