#include "recovery/segmentation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include <fmt/format.h>

#include "recovery/gaussian.h"
#include "recovery/morphology.h"
#include "recovery/topology_numbers.h"
#include "recovery/tunnels.h"
#include "recovery/vesselness.h"

namespace angiospline {
namespace {

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// A cube around a voxel, vessels bright, not-finite voxels left out of the values.
struct Cube {
  Image<double> grey;  // NaN where not finite
  Voxel seed;          // within it
  std::vector<double> values;
};

Cube cube_around(const AnyImage& image, const Voxel& centre, double half_mm, double sign) {
  const ImageGrid& grid = grid_of(image);
  Voxel low, size;
  for (std::size_t i = 0; i < 3; ++i) {
    const int half =
        static_cast<int>(std::lround(half_mm / grid.spacing_mm[static_cast<Eigen::Index>(i)]));
    low[i] = std::max(0, centre[i] - half);
    size[i] = std::min(grid.size[i] - 1, centre[i] + half) - low[i] + 1;
  }
  Cube cube;
  cube.grey.grid.size = size;
  cube.seed = {centre[0] - low[0], centre[1] - low[1], centre[2] - low[2]};
  for (int z = 0; z < size[2]; ++z)
    for (int y = 0; y < size[1]; ++y)
      for (int x = 0; x < size[0]; ++x) {
        const double v = sign * value_at(image, {low[0] + x, low[1] + y, low[2] + z});
        cube.grey.voxels.push_back(v);
        if (std::isfinite(v)) cube.values.push_back(v);
      }
  return cube;
}

// Voxels of the seed's component whose six neighbours in the cube belong to it too.
std::vector<double> inside_of(const Cube& cube, const Components& parts, std::int32_t label) {
  std::vector<double> inside;
  for (std::size_t i = 0; i < cube.grey.voxels.size(); ++i) {
    if (parts.labels.voxels[i] != label) continue;
    const Voxel v = cube.grey.grid.voxel(i);
    bool deep = true;
    for (std::size_t k = 0; k < 3; ++k)
      for (const int step : {-1, 1}) {
        Voxel n = v;
        n[k] += step;
        deep = deep && (!cube.grey.grid.contains(n) || parts.labels[n] == label);
      }
    if (deep) inside.push_back(cube.grey.voxels[i]);
  }
  return inside;
}

SeedLevels levels_in(const Cube& cube, double threshold, double half_mm, const ImageGrid& grid) {
  Mask bright(cube.grey.grid);
  std::vector<double> background;
  for (std::size_t i = 0; i < bright.voxels.size(); ++i) {
    bright.voxels[i] = cube.grey.voxels[i] >= threshold;
    if (cube.grey.voxels[i] < threshold) background.push_back(cube.grey.voxels[i]);
  }
  const Components parts = connected_components(bright, Neighbours::kCorners26);
  const std::int32_t label = parts.labels[cube.seed];
  std::vector<double> vessel = inside_of(cube, parts, label);
  if (vessel.size() < 8) {  // too thin to have an inside
    vessel.clear();
    for (std::size_t i = 0; i < bright.voxels.size(); ++i)
      if (parts.labels.voxels[i] == label) vessel.push_back(cube.grey.voxels[i]);
  }
  SeedLevels out;
  const double n = static_cast<double>(vessel.size());
  out.vessel = std::accumulate(vessel.begin(), vessel.end(), 0.0) / n;
  double squares = 0;
  for (const double v : vessel) squares += (v - out.vessel) * (v - out.vessel);
  out.vessel_deviation = std::sqrt(squares / n);
  out.background = median(background);
  for (double& v : background) v = std::abs(v - out.background);
  out.background_deviation = 1.4826 * median(background);
  const double volume =
      static_cast<double>(parts.list[static_cast<std::size_t>(label - 1)].voxels) *
      grid.spacing_mm.prod();
  out.radius_mm = std::sqrt(volume / (2 * half_mm * std::numbers::pi));
  return out;
}

// Grey values (vessels bright) around one voxel; none if no cube up to 40 voxels shows a
// background.
std::optional<SeedLevels> levels_at(const AnyImage& image, const Voxel& seed, double sign) {
  const ImageGrid& grid = grid_of(image);
  const double voxel = grid.spacing_mm.minCoeff();
  for (double half = 5; half <= 40; half *= 1.4) {
    const Cube cube = cube_around(image, seed, half * voxel, sign);
    if (cube.values.size() < 27) continue;
    const double threshold = otsu_threshold(cube.values);
    const auto below = std::count_if(cube.values.begin(), cube.values.end(),
                                     [&](double v) { return v < threshold; });
    if (static_cast<double>(below) < 0.6 * static_cast<double>(cube.values.size())) continue;
    if (!(cube.grey[cube.seed] >= threshold)) continue;
    return levels_in(cube, threshold, half * voxel, grid);
  }
  return std::nullopt;
}

SeedLevels median_of(const std::vector<SeedLevels>& all) {
  SeedLevels out;
  for (double SeedLevels::*field :
       {&SeedLevels::vessel, &SeedLevels::vessel_deviation, &SeedLevels::background,
        &SeedLevels::background_deviation, &SeedLevels::radius_mm}) {
    std::vector<double> values;
    for (const SeedLevels& l : all) values.push_back(l.*field);
    out.*field = median(std::move(values));
  }
  return out;
}

Voxel brightest_near(const AnyImage& image, const Vec3& seed_mm, int reach, double sign) {
  const ImageGrid& grid = grid_of(image);
  const Vec3 at = grid.index_vox(seed_mm);
  Voxel best{static_cast<int>(std::lround(at[0])), static_cast<int>(std::lround(at[1])),
             static_cast<int>(std::lround(at[2]))};
  const Voxel middle = best;
  for (int z = -reach; z <= reach; ++z)
    for (int y = -reach; y <= reach; ++y)
      for (int x = -reach; x <= reach; ++x) {
        const Voxel v{middle[0] + x, middle[1] + y, middle[2] + z};
        if (grid.contains(v) && sign * value_at(image, v) > sign * value_at(image, best)) best = v;
      }
  return best;
}

// Whether the grey values around a seed are those of a vessel in its background. Noise cut in two
// at its middle has classes 1.9 apart, in root sums of their squared deviations, and by chance up
// to 2.35 in the corners of the phantoms; a tube of radius 2.5 voxels at SNR 1, smoothed, has 2.7.
bool shows_vessel(const std::optional<SeedLevels>& levels) {
  constexpr double kLeastSeparation = 2.4;
  return levels &&
         levels->vessel - levels->background >=
             kLeastSeparation * std::hypot(levels->vessel_deviation, levels->background_deviation);
}

Error no_vessel_at(const Vec3& seed_mm) {
  return {ErrorKind::kBadInput,
          "no vessel at the seed",
          fmt::format("seed {:.6g},{:.6g},{:.6g} mm", seed_mm.x(), seed_mm.y(), seed_mm.z()),
          {},
          "it must lie on a voxel that stands out from its surroundings; N, M and a background "
          "threshold, all three given, grow from any seed"};
}

// Fills in what the caller left open, and says so. Errors: a given seed without a vessel.
Result<GrowOptions> chosen(const AnyImage& image, const SegmentOptions& options,
                           SegmentReport& report) {
  GrowOptions grow;
  grow.polarity = options.polarity;
  const double sign = options.polarity == Polarity::kBright ? 1 : -1;
  std::vector<SeedLevels> all;
  for (const Vec3& seed : report.seeds_mm) {
    const Voxel at = brightest_near(image, seed, 0, sign);
    if (!grid_of(image).contains(at)) continue;  // grow_region says so
    const auto levels =
        levels_at(image, brightest_near(image, seed, grow.seed_search_vox, sign), sign);
    const bool all_given = options.neighbourhood_vox && options.deviations && options.background;
    if (!report.seeds_found && !all_given && !shows_vessel(levels)) return fail(no_vessel_at(seed));
    if (levels) all.push_back(*levels);
  }
  if (!all.empty()) {
    SeedLevels l = median_of(all);
    const double contrast = l.vessel - l.background;
    const double r_vox = l.radius_mm / grid_of(image).spacing_mm.minCoeff();
    grow.neighbourhood_vox = std::clamp(2 * static_cast<int>(std::lround(r_vox)) + 1, 5, 11);
    grow.deviations = 2;
    if (l.vessel_deviation > 0)
      grow.deviations = std::clamp(0.5 * contrast / l.vessel_deviation, 1.0, 2.0);
    const double floor = std::clamp(2 * l.background_deviation, 0.2 * contrast, 0.4 * contrast);
    if (!options.background) grow.background = sign * (l.background + floor);
    grow.background_level = sign * l.background;
    grow.vessel_level = sign * l.vessel;
    l.vessel *= sign;
    l.background *= sign;
    report.levels = l;
    report.choices.push_back(fmt::format(
        "at the seeds the vessel is {:.4g} +- {:.3g}, its background {:.4g} +- {:.3g}, its radius "
        "about {:.2g} mm",
        l.vessel, l.vessel_deviation, l.background, l.background_deviation, l.radius_mm));
    if (!options.neighbourhood_vox)
      report.choices.push_back(fmt::format("N = {}", grow.neighbourhood_vox));
    if (!options.deviations) report.choices.push_back(fmt::format("M = {:.3g}", grow.deviations));
    if (grow.background)
      report.choices.push_back(fmt::format("background threshold {:.4g}", *grow.background));
  } else {
    report.warnings.push_back(
        "no contrast was found around the seeds: the rule of growing is the plain one");
  }
  if (options.neighbourhood_vox) grow.neighbourhood_vox = *options.neighbourhood_vox;
  if (options.deviations) grow.deviations = *options.deviations;
  if (options.background) grow.background = options.background;
  return grow;
}

// A tree of vessels has few loops (the circle of Willis one, a kissing pair one more); a leak into
// tissue runs round every dark spot there.
constexpr std::int64_t kLoopsOfALeak = 20;
constexpr std::size_t kNoLimit = std::numeric_limits<std::size_t>::max();

struct Attempt {
  Mask mask;
  SegmentReport report;
  std::int64_t loops = 0;

  bool leaks() const { return loops > kLoopsOfALeak; }
};

// Grows from the report's seeds on the smoothed image, without looking at more than `most_examined`
// voxels, and cleans the mask up.
Result<Attempt> attempt(const AnyImage& image, const SegmentOptions& options, SegmentReport report,
                        std::size_t most_examined, const Progress& progress) {
  Result<GrowOptions> choice = chosen(image, options, report);
  if (!choice) return fail(choice.error());
  GrowOptions grow = *choice;
  if (options.max_examined) most_examined = std::min(most_examined, *options.max_examined);
  grow.max_examined = most_examined;
  if (report.seeds_found) grow.seed_search_vox = 2;
  report.neighbourhood_vox = grow.neighbourhood_vox;
  report.deviations = grow.deviations;
  report.background = grow.background.value_or(0);
  Result<Segmentation> grown = grow_region(image, report.seeds_mm, grow, progress);
  if (!grown) return fail(grown.error());
  report.grown = std::move(grown->report);
  if (report.grown.limit_reached && options.max_examined == most_examined)
    report.warnings.push_back(
        fmt::format("growing stopped after {} voxels examined", report.grown.examined));
  Filled holes = fill_holes(std::move(grown->mask), options.largest_hole_vox);
  Filled cavities = fill_cavities(std::move(holes.mask));
  Result<ClosedTunnels> closed = close_tunnels(std::move(cavities.mask), {}, progress);
  if (!closed) return fail(closed.error());
  report.filled_voxels = holes.voxels + cavities.voxels + closed->voxels;
  if (closed->tunnels > 0)
    report.choices.push_back(
        fmt::format("{} tunnels too narrow to be loops of vessels are filled", closed->tunnels));
  report.components = component_count(closed->mask, Neighbours::kCorners26);
  const std::int64_t loops = topology_numbers(closed->mask).cycles;
  return Attempt{std::move(closed->mask), std::move(report), loops};
}

// As attempt, but a leak is not followed to its end: vessels are a small part of an image.
Result<Attempt> cautious_attempt(const AnyImage& image, const SegmentOptions& options,
                                 const SegmentReport& report, const Progress& progress) {
  constexpr std::size_t kMuch = 10;  // one part in so many
  const std::size_t much = grid_of(image).voxel_count() / kMuch;
  Result<Attempt> first = attempt(image, options, report, much, progress);
  if (!first || first->leaks() || !first->report.grown.limit_reached) return first;
  return attempt(image, options, report, kNoLimit, progress);  // so much vessel there is
}

std::string leak_warning(const Attempt& leaking) {
  std::string text = fmt::format(
      "the mask has {} loops: it has probably leaked into tissue; a higher background threshold, a "
      "smaller M or other seeds may help",
      leaking.loops);
  if (leaking.report.grown.limit_reached)
    text += fmt::format("; growing was stopped after {} voxels", leaking.report.grown.examined);
  const std::vector<FrontLeap>& leaps = leaking.report.grown.leaps;
  const auto largest =
      std::max_element(leaps.begin(), leaps.end(),
                       [](const FrontLeap& a, const FrontLeap& b) { return a.opened < b.opened; });
  if (largest != leaps.end())
    text += fmt::format(
        "; the front grew most suddenly, by {} voxels, at voxel {},{},{} (grey {:.4g})",
        largest->opened, largest->neck[0], largest->neck[1], largest->neck[2], largest->grey);
  return text;
}

// A background threshold at which the leak should be shut: just above the neck behind which the
// front first found more than it had before, or else a tenth of the contrast higher.
double raised_background(const SegmentReport& report, double sign) {
  constexpr double kStep = 0.1, kAboveNeck = 0.01;
  const double contrast = report.levels->vessel - report.levels->background;  // of either sign
  for (const FrontLeap& leap : report.grown.leaps)
    if (leap.opened >= leap.before && sign * leap.grey > sign * report.background)
      return leap.grey + kAboveNeck * contrast;
  return report.background + kStep * contrast;
}

// The seeds that lie in what the threshold leaves of the vessels.
std::vector<Vec3> seeds_beyond(const AnyImage& image, const std::vector<Vec3>& seeds,
                               double background, double sign) {
  constexpr int kSearch = 2;
  std::vector<Vec3> left;
  for (const Vec3& seed : seeds) {
    const Voxel v = brightest_near(image, seed, kSearch, sign);
    if (grid_of(image).contains(v) && sign * value_at(image, v) > sign * background)
      left.push_back(seed);
  }
  return left;
}

// Grows again with higher and higher background thresholds as long as the mask leaks; seeds that
// were found and are darker were none of vessels. The last attempt if none is sound.
Result<Attempt> without_leak(const AnyImage& image, SegmentOptions options, Attempt leaking,
                             const Progress& progress) {
  constexpr int kAttempts = 8;
  const double sign = options.polarity == Polarity::kBright ? 1 : -1;
  std::vector<std::string> first_choices;
  if (leaking.report.seeds_found) first_choices.push_back(leaking.report.choices.front());
  for (int k = 0; k < kAttempts && leaking.leaks(); ++k) {
    SegmentReport report;
    report.seeds_found = leaking.report.seeds_found;
    options.background = raised_background(leaking.report, sign);
    report.seeds_mm = seeds_beyond(image, leaking.report.seeds_mm, *options.background, sign);
    if (report.seeds_mm.empty() ||
        (!report.seeds_found && report.seeds_mm.size() < leaking.report.seeds_mm.size()))
      return leaking;
    report.choices = first_choices;
    report.choices.push_back(fmt::format(
        "the background threshold is {:.4g}, {} of {} seeds lie beyond it: with {:.4g} growing "
        "leaked into tissue ({} loops)",
        *options.background, report.seeds_mm.size(), leaking.report.seeds_mm.size(),
        leaking.report.background, leaking.loops));
    Result<Attempt> next = cautious_attempt(image, options, report, progress);
    if (!next) return fail(next.error());
    leaking = std::move(*next);
  }
  return leaking;
}

}  // namespace

Result<Segmented> segment(AnyImage image, const SegmentOptions& options, const Progress& progress) {
  SegmentReport report;
  report.seeds_mm = options.seeds_mm;
  if (options.seeds_mm.empty()) {
    SeedSearchOptions seed_options;
    seed_options.polarity = options.polarity;
    Result<std::vector<Vec3>> seeds = find_seeds(image, seed_options, progress);
    if (!seeds) return fail(seeds.error());
    if (seeds->empty())
      return fail({ErrorKind::kFailed,
                   "no vessel was found",
                   "segment",
                   {},
                   "nothing in the image looks like a tube: give a seed"});
    report.seeds_mm = std::move(*seeds);
    report.seeds_found = true;
    report.choices.push_back(fmt::format("{} seeds in the cores of the most tubular structures",
                                         report.seeds_mm.size()));
  }
  if (progress.should_stop()) return fail(cancelled("segment"));
  image = smoothed(std::move(image), options.smoothing_vox * grid_of(image).spacing_mm.minCoeff());
  Result<Attempt> done = options.background
                             ? attempt(image, options, std::move(report), kNoLimit, progress)
                             : cautious_attempt(image, options, report, progress);
  if (done && done->leaks() && !options.background && done->report.levels)
    done = without_leak(image, options, std::move(*done), progress);
  if (!done) return fail(done.error());
  if (done->leaks()) done->report.warnings.push_back(leak_warning(*done));
  return Segmented{std::move(done->mask), std::move(done->report)};
}

}  // namespace angiospline
