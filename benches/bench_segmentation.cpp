// Segmentation of a noisy random tree, ours or ITK's ConfidenceConnected, one process each so that
// the peak memory is its own:
//   bench_segmentation ours|itk [edge 512] [snr 8] [M 2]
// and without arguments both of them, with the multipliers of the documented table.
// Prints CPU seconds of the segmentation alone, peak memory, Dice and topology. Both get the same
// image (int16) and the same seed; ITK's multiplier is M, two iterations, radius 2.
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <string>

#include <itkConfidenceConnectedImageFilter.h>
#include <itkImage.h>

#include "recovery/metrics.h"
#include "recovery/phantom.h"
#include "recovery/segmentation.h"

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

Mask by_itk(const Image<std::int16_t>& image, const Vec3& seed_mm, double multiplier) {
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
  filter->Update();
  Mask mask(image.grid);
  std::copy_n(filter->GetOutput()->GetBufferPointer(), mask.voxels.size(), mask.voxels.begin());
  return mask;
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
  forget_peak();
  const double before = status_megabytes("VmRSS"), start = cpu_seconds();
  Mask mask;
  if (who == "itk") {
    mask = by_itk(made->image, seed, deviations);
  } else {
    SegmentOptions options;
    options.seeds_mm = {seed};
    if (argc > 4) options.deviations = deviations;
    auto segmented = segment(std::move(made->image), options);
    if (!segmented) {
      std::fprintf(stderr, "%s\n", segmented.error().message().c_str());
      return 1;
    }
    mask = std::move(segmented->mask);
  }
  const double seconds = cpu_seconds() - start, memory = status_megabytes("VmHWM") - before;
  const auto c = compare_masks(made->truth, mask);
  std::printf(
      "%s edge %.0f SNR %.3g: %.2f s CPU, %.0f MB more than before, Dice %.4f, "
      "%lld pieces, %lld tunnels, %lld cavities\n",
      who.c_str(), edge, *phantom.snr, seconds, memory, c->dice,
      static_cast<long long>(c->result_topology.components),
      static_cast<long long>(c->result_topology.cycles),
      static_cast<long long>(c->result_topology.cavities));
}
