// Segmentation of a noisy random tree, ours or ITK's ConfidenceConnected, one process each so that
// the peak memory is its own:
//   bench_segmentation ours|itk [edge 512] [snr 8] [M 2]
//   bench_segmentation large [edge 1024]      ours on uint8, SNR 8, then thinning; all processors
// and without arguments both of them, with the multipliers of the documented table.
// Prints CPU seconds of the segmentation alone, peak memory beyond the image, Dice and topology.
// Both get the same image (int16), the same seed and one thread; ITK's multiplier is M, two
// iterations, radius 2. The result of either is counted, ITK's copy into our mask is not.
#include <bit>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <optional>
#include <string>

#include <itkConfidenceConnectedImageFilter.h>
#include <itkImage.h>
#include <itkMultiThreaderBase.h>
#include <tbb/global_control.h>

#include "recovery/analysis/compare_masks.h"
#include "recovery/centerlines/vessels_from_mask.h"
#include "recovery/imaging/mask/topology_numbers.h"
#include "recovery/imaging/segment/segment.h"
#include "recovery/imaging/skeleton/thinning.h"
#include "recovery/phantoms/phantom.h"
#include "tests/shapes/random_trees.h"

namespace {

using namespace angiospline;

double cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

// A figure of /proc/self/status, in MB: VmRSS is the memory now, VmHWM its peak.
double status_megabytes(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.rfind(key + ":", 0) == 0) return std::atof(line.c_str() + key.size() + 1) / 1024;
  return 0;
}

void forget_peak() { std::ofstream("/proc/self/clear_refs") << 5; }

struct Measured {
  Mask mask;
  double seconds = 0;
  double megabytes = 0;  // beyond what there was
};

class Meter {
 public:
  Meter() {
    forget_peak();
    before_ = status_megabytes("VmRSS");
    start_ = cpu_seconds();
  }
  void read(Measured& m) const {
    m.seconds = cpu_seconds() - start_;
    m.megabytes = status_megabytes("VmHWM") - before_;
  }

 private:
  double before_, start_;
};

Measured by_itk(const Image<std::int16_t>& image, const Vec3& seed_mm, double multiplier) {
  using Volume = itk::Image<std::int16_t, 3>;
  using Labels = itk::Image<std::uint8_t, 3>;
  const auto volume = Volume::New();
  Volume::RegionType region;
  Volume::IndexType seed;
  for (unsigned i = 0; i < 3; ++i) {
    region.SetSize(i, static_cast<itk::SizeValueType>(image.grid.size[i]));
    seed[i] = std::lround(image.grid.index_vox(seed_mm)[i]);
  }
  volume->SetRegions(region);
  // Borrowed, so that the image is not counted twice.
  volume->GetPixelContainer()->SetImportPointer(const_cast<std::int16_t*>(image.voxels.data()),
                                                image.voxels.size(), false);
  const auto filter = itk::ConfidenceConnectedImageFilter<Volume, Labels>::New();
  filter->SetInput(volume);
  filter->SetSeed(seed);
  filter->SetMultiplier(multiplier);
  filter->SetNumberOfIterations(2);
  filter->SetInitialNeighborhoodRadius(2);
  filter->SetReplaceValue(1);
  Measured m;
  const Meter meter;
  filter->Update();
  meter.read(m);
  m.mask = Mask(image.grid);
  std::copy_n(filter->GetOutput()->GetBufferPointer(), m.mask.voxels.size(), m.mask.voxels.begin());
  return m;
}

std::optional<Measured> by_us(const AnyImage& image, const Vec3& seed_mm,
                              std::optional<double> deviations) {
  SegmentOptions options;
  options.seeds_mm = {seed_mm};
  options.deviations = deviations;
  Measured m;
  const Meter meter;
  auto segmented = segment(image, options);
  if (!segmented) {
    std::fprintf(stderr, "%s\n", segmented.error().message().c_str());
    return std::nullopt;
  }
  meter.read(m);
  m.mask = std::move(segmented->mask);
  return m;
}

// Segmentation and thinning of a uint8 volume that is made here without any other of its size.
int large(int edge) {
  test::RandomTreeOptions options;
  options.extent_mm = edge;
  options.root_radius_mm = edge * 30 / 1024.0;
  options.least_radius_mm = edge * 4 / 1024.0;
  options.most_branches = 121;
  Random random(4);
  const CenterlineTree tree = test::RandomTree(options, random).grow();
  Image<std::uint8_t> image(test::empty_mask({edge, edge, edge}).grid);
  test::paint(image, tree);
  std::uint64_t state = 1;
  for (std::uint8_t& v : image.voxels) {
    state = state * 6364136223846793005U + 1442695040888963407U;
    // The bits set of 64 random ones: all but normal, of deviation 4.
    const int noise = std::popcount(state ^ state >> 32) - 32;
    v = static_cast<std::uint8_t>((v != 0 ? 180 : 80) + 100 * noise / (4 * 8));
  }
  const Vec3 seed = tree.branches.front().points_mm.col(8);
  using Clock = std::chrono::steady_clock;
  const auto seconds = [](Clock::time_point since) {
    return std::chrono::duration<double>(Clock::now() - since).count();
  };
  const AnyImage any = std::move(image);
  auto start = Clock::now();
  std::optional<Measured> m = by_us(any, seed, std::nullopt);
  if (!m) return 1;
  const double wall = seconds(start);
  const TopologyNumbers before = topology_numbers(m->mask);
  Measured thinned;
  const Meter meter;
  start = Clock::now();
  thinned.mask = thin(std::move(m->mask)).value();
  meter.read(thinned);
  std::printf(
      "uint8 %d^3: segment %.1f s (%.1f s CPU), %.0f MB beyond the image; thin %.1f s (%.1f s "
      "CPU), "
      "%.0f MB more; %lld pieces, %lld cycles, topology %s\n",
      edge, wall, m->seconds, m->megabytes, seconds(start), thinned.seconds, thinned.megabytes,
      static_cast<long long>(before.components), static_cast<long long>(before.cycles),
      before == topology_numbers(thinned.mask) ? "kept" : "CHANGED");
  return 0;
}

// Each line of the table by a process of its own.
int all_of_them(const std::string& program) {
  int failures = 0;
  for (const char* line : {"ours 512 8", "ours 512 4", "ours 512 8 1", "ours 512 8 3",
                           "itk 512 8 2.0", "itk 512 8 2.5"})
    failures += std::system((program + " " + line).c_str()) != 0;
  return failures > 0 ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 1) return all_of_them(argv[0]);
  if (argv[1] == std::string("large")) return large(argc > 2 ? std::atoi(argv[2]) : 1024);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  itk::MultiThreaderBase::SetGlobalDefaultNumberOfThreads(1);
  const std::string who = argc > 1 ? argv[1] : "ours";
  const double edge = argc > 2 ? std::atof(argv[2]) : 512;
  PhantomOptions phantom;
  phantom.field_mm = edge;
  phantom.radius_max_mm = edge * 12 / 512;
  phantom.radius_min_mm = edge * 3 / 512;
  phantom.snr = argc > 3 ? std::atof(argv[3]) : 8;
  const double deviations = argc > 4 ? std::atof(argv[4]) : 2;
  auto made = make_phantom(PhantomKind::kRandomTree, phantom);
  if (!made) {
    std::fprintf(stderr, "%s\n", made.error().message().c_str());
    return 1;
  }
  const Vec3 seed = made->tree.branches.front().points_mm.col(8);
  std::optional<Measured> m;
  if (who == "itk")
    m = by_itk(made->image, seed, deviations);
  else
    m = by_us(std::move(made->image), seed,
              argc > 4 ? std::optional<double>(deviations) : std::nullopt);
  if (!m) return 1;
  const auto c = compare_masks(made->truth, m->mask);
  const auto vessels = vessels_from_mask(m->mask);
  std::printf(
      "%s edge %.0f SNR %.3g: %.2f s CPU, %.0f MB more than before, Dice %.4f, "
      "%lld pieces, %lld tunnels, %lld cavities; %zu of %zu branches\n",
      who.c_str(), edge, *phantom.snr, m->seconds, m->megabytes, c->dice,
      static_cast<long long>(c->result_topology.components),
      static_cast<long long>(c->result_topology.cycles),
      static_cast<long long>(c->result_topology.cavities),
      vessels ? vessels->tree.branches.size() : 0, made->tree.branches.size());
}
