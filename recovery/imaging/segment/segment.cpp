#include "recovery/imaging/segment/segment.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "recovery/imaging/mask/morphology.h"
#include "recovery/imaging/mask/topology_numbers.h"
#include "recovery/imaging/mask/tunnels.h"
#include "recovery/imaging/segment/rules.h"
#include "recovery/imaging/segment/seed_levels.h"
#include "recovery/imaging/segment/seed_search.h"

namespace angiospline {

using namespace segmentation;

namespace {

// Whether the grey values around a seed are those of a vessel in its background.
bool shows_vessel(const std::optional<SeedLevels>& levels) {
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

double smoothing_mm(const AnyImage& image, const SegmentOptions& options) {
  return options.smoothing_vox * grid_of(image).spacing_mm.minCoeff();
}

// Sets the rule of growing that the levels at the seeds ask for, and says what it chose.
void follow_levels(SeedLevels l, double sign, double voxel_mm, const SegmentOptions& options,
                   GrowOptions& grow, SegmentReport& report) {
  const double contrast = l.vessel - l.background;
  grow.neighbourhood_vox =
      std::clamp(2 * static_cast<int>(std::lround(l.radius_mm / voxel_mm)) + 1, kLeastN, kMostN);

  // M sigma is to be at most half the contrast: noise must not carry the threshold into the
  // background.
  grow.deviations = kMostM;
  if (l.vessel_deviation > 0)
    grow.deviations = std::clamp(kMostOfContrast * contrast / l.vessel_deviation, kLeastM, kMostM);
  const double floor = std::clamp(kBackgroundDeviations * l.background_deviation,
                                  kLeastFloor * contrast, kMostFloor * contrast);
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
}

// Fills in what the caller left open, and says so. Errors: a given seed without a vessel.
Result<GrowOptions> chosen(const AnyImage& image, const SegmentOptions& options,
                           SegmentReport& report) {
  GrowOptions grow;
  grow.polarity = options.polarity;
  grow.smoothing_mm = smoothing_mm(image, options);
  const double sign = options.polarity == Polarity::kBright ? 1 : -1;

  std::vector<SeedLevels> all;
  for (const Vec3& seed : report.seeds_mm) {
    const Voxel at = voxel_at(grid_of(image), seed);
    if (!grid_of(image).contains(at)) continue;  // grow_region says so
    const auto levels = levels_at(
        image, brightest_near(image, at, grow.seed_search_vox, sign, grow.smoothing_mm).at, sign,
        grow.smoothing_mm);
    const bool all_given = options.neighbourhood_vox && options.deviations && options.background;
    if (!report.seeds_found && !all_given && !shows_vessel(levels)) return fail(no_vessel_at(seed));
    if (levels) all.push_back(*levels);
  }
  if (all.empty()) {
    report.warnings.push_back(
        {WarningCode::kNoContrastAtSeeds,
         "no contrast was found around the seeds: the rule of growing is the plain one"});
  } else {
    follow_levels(median_of(all), sign, grid_of(image).spacing_mm.minCoeff(), options, grow,
                  report);
  }

  // What the caller gave has the last word.
  if (options.neighbourhood_vox) grow.neighbourhood_vox = *options.neighbourhood_vox;
  if (options.deviations) grow.deviations = *options.deviations;
  if (options.background) grow.background = options.background;
  return grow;
}

// A tree of vessels has few loops (the circle of Willis one, a kissing pair one more); a leak into
// tissue runs round every dark spot there.
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
  if (report.seeds_found) grow.seed_search_vox = kSeedReach;
  report.neighbourhood_vox = grow.neighbourhood_vox;
  report.deviations = grow.deviations;
  report.background = grow.background.value_or(0);

  Result<Segmentation> grown = grow_region(image, report.seeds_mm, grow, progress);
  if (!grown) return fail(grown.error());
  report.grown = std::move(grown->report);
  if (report.grown.limit_reached && options.max_examined == most_examined)
    report.warnings.push_back(
        {WarningCode::kGrowingStopped,
         fmt::format("growing stopped after {} voxels examined", report.grown.examined)});

  // What noise leaves in a mask: holes, cavities and tunnels too narrow to be loops of vessels.
  Filled holes = fill_holes(std::move(grown->mask), options.largest_hole_vox);
  Filled cavities = fill_cavities(std::move(holes.mask));
  Result<ClosedTunnels> closed = close_tunnels(std::move(cavities.mask), {}, progress);
  if (!closed) return fail(closed.error());
  report.filled_voxels = holes.voxels + cavities.voxels + closed->voxels;
  if (closed->tunnels > 0)
    report.choices.push_back(
        fmt::format("{} tunnels too narrow to be loops of vessels are filled", closed->tunnels));

  report.components = static_cast<std::size_t>(closed->topology.components);
  return Attempt{std::move(closed->mask), std::move(report), closed->topology.cycles};
}

// As attempt, but a leak is not followed to its end: vessels are a small part of an image.
Result<Attempt> cautious_attempt(const AnyImage& image, const SegmentOptions& options,
                                 const SegmentReport& report, const Progress& progress) {
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
  const double contrast = report.levels->vessel - report.levels->background;  // of either sign
  for (const FrontLeap& leap : report.grown.leaps)
    if (leap.opened >= leap.before && sign * leap.grey > sign * report.background)
      return leap.grey + kAboveNeck * contrast;
  return report.background + kStep * contrast;
}

// The seeds that lie in what the threshold leaves of the vessels.
std::vector<Vec3> seeds_beyond(const AnyImage& image, const std::vector<Vec3>& seeds,
                               double background, double sign, double smoothing) {
  std::vector<Vec3> left;
  for (const Vec3& seed : seeds) {
    const Voxel v = voxel_at(grid_of(image), seed);
    if (grid_of(image).contains(v) &&
        brightest_near(image, v, kSeedReach, sign, smoothing).grey > sign * background)
      left.push_back(seed);
  }
  return left;
}

// Grows again with higher and higher background thresholds as long as the mask leaks; seeds that
// were found and are darker were none of vessels. The last attempt if none is sound.
Result<Attempt> without_leak(const AnyImage& image, SegmentOptions options, Attempt leaking,
                             const std::vector<std::string>& first_choices,
                             const Progress& progress) {
  const double sign = options.polarity == Polarity::kBright ? 1 : -1;
  for (int k = 0; k < kAttempts && leaking.leaks(); ++k) {
    SegmentReport report;
    report.seeds_found = leaking.report.seeds_found;
    options.background = raised_background(leaking.report, sign);

    report.seeds_mm = seeds_beyond(image, leaking.report.seeds_mm, *options.background, sign,
                                   smoothing_mm(image, options));
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

std::string swelling_text(const Swelling& s) {
  const std::string where =
      fmt::format("voxel {},{},{} (grey {:.4g})", s.neck[0], s.neck[1], s.neck[2], s.grey);
  const std::string what =
      fmt::format("{} voxels behind {} are up to {:.3g} mm deep and the vessel before it {:.3g} mm",
                  s.voxels, where, s.beyond_depth_mm, s.vessel_depth_mm);
  return s.cut
             ? what + ": they are left out"
             : what + ": tissue behind a leak, or a wider vessel; --cut-swellings leaves them out";
}

// The neck behind which the front found most, and at least as much as it had; null if there is
// none. Where it is about as bright as the vessel it is no neck but noise.
const FrontLeap* widest_neck(const SegmentReport& report, double sign) {
  if (!report.levels) return nullptr;
  const SeedLevels& l = *report.levels;
  const double darker =
      std::max(kDarker * std::abs(l.vessel - l.background), kDarkerDeviations * l.vessel_deviation);
  const FrontLeap* widest = nullptr;
  for (const FrontLeap& leap : report.grown.leaps)
    if (leap.before >= kLeastBefore && leap.opened >= leap.before &&
        sign * leap.grey > sign * report.background &&
        sign * leap.grey < sign * l.vessel - darker &&
        (widest == nullptr || leap.opened > widest->opened))
      widest = &leap;
  return widest;
}

// Grows once more with a threshold just above the neck behind which the front found most, and
// compares. Says so if a swelling lies there, and leaves it out if that was asked for.
Result<Attempt> without_swelling(const AnyImage& image, SegmentOptions options, Attempt whole,
                                 const Progress& progress) {
  const double sign = options.polarity == Polarity::kBright ? 1 : -1;
  const FrontLeap* largest = widest_neck(whole.report, sign);
  if (largest == nullptr) return whole;

  // Grown once more, up to just above the neck: what is missing then lies behind it.
  const SeedLevels& levels = *whole.report.levels;
  options.background = largest->grey + kAboveNeck * (levels.vessel - levels.background);
  SegmentReport report;
  report.seeds_found = whole.report.seeds_found;
  report.seeds_mm = seeds_beyond(image, whole.report.seeds_mm, *options.background, sign,
                                 smoothing_mm(image, options));
  if (report.seeds_mm.empty()) return whole;

  Result<Attempt> before = attempt(image, options, report, kNoLimit, progress);
  if (!before && before.error().kind == ErrorKind::kCancelled) return fail(before.error());
  if (!before) return whole;  // nothing grows from the seeds so bright

  std::optional<SwellingParts> parts = find_swelling(whole.mask, std::move(before->mask));
  if (!parts) return whole;

  parts->swelling.grey = largest->grey;
  parts->swelling.cut = options.cut_swellings;
  if (options.cut_swellings) {
    const TopologyNumbers topology = topology_numbers(parts->vessel);
    whole.mask = std::move(parts->vessel);
    whole.loops = topology.cycles;
    whole.report.components = static_cast<std::size_t>(topology.components);
  }

  whole.report.warnings.push_back({WarningCode::kSwelling, swelling_text(parts->swelling)});
  whole.report.swelling = parts->swelling;
  return whole;
}

}  // namespace

Result<Segmented> segment(const AnyImage& image, const SegmentOptions& options,
                          const Progress& progress) {
  SegmentReport report;
  report.seeds_mm = options.seeds_mm;
  if (options.seeds_mm.empty()) {
    SeedSearchOptions seed_options;
    seed_options.polarity = options.polarity;
    Result<SeedSearch> seeds = find_seeds(image, seed_options, progress);
    if (!seeds) return fail(seeds.error());
    if (seeds->kept.empty())
      return fail({ErrorKind::kBadInput,
                   "no vessel was found",
                   "segment",
                   {},
                   "nothing in the image looks like a tube: give a seed"});
    for (const TubularStructure& s : seeds->kept) report.seeds_mm.push_back(s.core_mm);
    report.seeds_found = true;
    report.choices.push_back(
        fmt::format("{} seeds in the cores of the brightest tubes", report.seeds_mm.size()));
    report.choices.insert(report.choices.end(), seeds->left_out.begin(), seeds->left_out.end());
  }

  if (progress.should_stop()) return fail(cancelled("segment"));

  Result<Attempt> done = options.background ? attempt(image, options, report, kNoLimit, progress)
                                            : cautious_attempt(image, options, report, progress);
  if (done && done->leaks() && !options.background && done->report.levels)
    done = without_leak(image, options, std::move(*done), report.choices, progress);
  if (!done) return fail(done.error());

  if (done->leaks())
    done->report.warnings.push_back({WarningCode::kProbableLeak, leak_warning(*done)});
  else
    done = without_swelling(image, options, std::move(*done), progress);
  if (!done) return fail(done.error());
  return Segmented{std::move(done->mask), std::move(done->report)};
}

}  // namespace angiospline
