// Vesselness, ours against ITK's, on the grid that automatic seeds are looked for on:
//   bench_vesselness FILE...          images (or folders of a DICOM series)
// One thread each. ITK's filter is MultiScaleHessianBasedMeasureImageFilter with the objectness of
// HessianToObjectnessMeasureImageFilter: with alpha = beta = 0.5, scaled by the largest eigenvalue
// and without a noise term it is the same formula.
#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <string>

#include <itkHessianToObjectnessMeasureImageFilter.h>
#include <itkImage.h>
#include <itkMultiScaleHessianBasedMeasureImageFilter.h>
#include <itkMultiThreaderBase.h>
#include <tbb/global_control.h>

#include "io/images/image_file.h"
#include "recovery/imaging/segment/seed_search.h"
#include "recovery/imaging/segment/vesselness.h"

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

struct Answer {
  Image<float> image;
  double seconds = 0, megabytes = 0;
};

template <typename Work>
Answer measured(Work&& work) {
  std::ofstream("/proc/self/clear_refs") << 5;
  const double before = status_megabytes("VmRSS"), start = cpu_seconds();
  Answer answer{work()};
  answer.seconds = cpu_seconds() - start;
  answer.megabytes = status_megabytes("VmHWM") - before;
  return answer;
}

// The deviations of our default scales, one after the other, and the largest answer of all: ITK's
// own steps are even or logarithmic, ours neither.
Image<float> by_itk(const Image<float>& image) {
  using Volume = itk::Image<float, 3>;
  using Hessian = itk::Image<itk::SymmetricSecondRankTensor<double, 3>, 3>;
  const auto volume = Volume::New();
  Volume::RegionType region;
  Volume::SpacingType spacing;
  for (unsigned i = 0; i < 3; ++i) {
    region.SetSize(i, static_cast<itk::SizeValueType>(image.grid.size[i]));
    spacing[i] = image.grid.spacing_mm[i];
  }
  volume->SetRegions(region);
  volume->SetSpacing(spacing);
  volume->GetPixelContainer()->SetImportPointer(const_cast<float*>(image.voxels.data()),
                                                image.voxels.size(), false);
  Image<float> best(image.grid);
  for (const double radius : VesselnessOptions{}.radii_vox) {
    const auto measure = itk::HessianToObjectnessMeasureImageFilter<Hessian, Volume>::New();
    measure->SetObjectDimension(1);
    measure->SetBrightObject(true);
    measure->SetScaleObjectnessMeasure(true);
    measure->SetAlpha(0.5);
    measure->SetBeta(0.5);
    measure->SetGamma(1e-6);
    const auto filter =
        itk::MultiScaleHessianBasedMeasureImageFilter<Volume, Hessian, Volume>::New();
    filter->SetInput(volume);
    filter->SetHessianToMeasureFilter(measure);
    const double sigma = radius / std::sqrt(2.0) * image.grid.spacing_mm.minCoeff();
    filter->SetSigmaMinimum(sigma);
    filter->SetSigmaMaximum(sigma);
    filter->SetNumberOfSigmaSteps(1);
    filter->SetNonNegativeHessianBasedMeasure(true);
    filter->Update();
    const float* out = filter->GetOutput()->GetBufferPointer();
    for (std::size_t i = 0; i < best.voxels.size(); ++i)
      best.voxels[i] = std::max(best.voxels[i], out[i]);
  }
  return best;
}

double correlation(const Image<float>& a, const Image<float>& b) {
  double n = 0, sa = 0, sb = 0, saa = 0, sbb = 0, sab = 0;
  for (std::size_t i = 0; i < a.voxels.size(); ++i) {
    const double x = static_cast<double>(a.voxels[i]), y = static_cast<double>(b.voxels[i]);
    if (x == 0 && y == 0) continue;
    n += 1, sa += x, sb += y, saa += x * x, sbb += y * y, sab += x * y;
  }
  return (sab - sa * sb / n) / std::sqrt((saa - sa * sa / n) * (sbb - sb * sb / n));
}

float largest(const Image<float>& image) {
  return *std::max_element(image.voxels.begin(), image.voxels.end());
}

// Overlap of what answers a quarter as strong as the strongest voxel: where seeds come from.
double dice_of_structures(const Image<float>& a, const Image<float>& b) {
  const float ta = largest(a) / 4, tb = largest(b) / 4;
  double both = 0, sum = 0;
  for (std::size_t i = 0; i < a.voxels.size(); ++i) {
    const bool x = a.voxels[i] >= ta, y = b.voxels[i] >= tb;
    both += x && y;
    sum += x + y;
  }
  return 2 * both / sum;
}

int compare(const std::string& path) {
  const auto file = read_image(path);
  if (!file) {
    std::fprintf(stderr, "%s\n", file.error().message().c_str());
    return 1;
  }
  const Image<float> image = seed_grid_image(file->image, Polarity::kBright);
  const Answer ours = measured([&] { return vesselness(image)->answer; });
  const Answer itk = measured([&] { return by_itk(image); });
  std::printf(
      "%s %dx%dx%d: ours %.2f s CPU, %.0f MB; ITK %.2f s, %.0f MB; correlation %.3f, Dice of the "
      "structures %.3f; strongest %.1f, %.1f\n",
      path.c_str(), image.grid.size[0], image.grid.size[1], image.grid.size[2], ours.seconds,
      ours.megabytes, itk.seconds, itk.megabytes, correlation(ours.image, itk.image),
      dice_of_structures(ours.image, itk.image), static_cast<double>(largest(ours.image)),
      static_cast<double>(largest(itk.image)));
  const auto seeds = find_seeds(file->image);
  for (const TubularStructure& s : seeds->kept) {
    const Vec3 at = image.grid.index_vox(s.core_mm);
    const Voxel v{static_cast<int>(std::lround(at[0])), static_cast<int>(std::lround(at[1])),
                  static_cast<int>(std::lround(at[2]))};
    std::printf("  seed %.1f,%.1f,%.1f mm: %.2f of the strongest, ITK %.2f\n", s.core_mm.x(),
                s.core_mm.y(), s.core_mm.z(),
                static_cast<double>(ours.image[v] / largest(ours.image)),
                static_cast<double>(itk.image[v] / largest(itk.image)));
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  itk::MultiThreaderBase::SetGlobalDefaultNumberOfThreads(1);
  if (argc < 2) std::fprintf(stderr, "bench_vesselness IMAGE...: nothing to do\n");
  int failures = 0;
  for (int i = 1; i < argc; ++i) failures += compare(argv[i]);
  return failures > 0 ? 1 : 0;
}
