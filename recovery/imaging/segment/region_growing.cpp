#include "recovery/imaging/segment/region_growing.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "recovery/imaging/image/pixel_types.h"
#include "recovery/imaging/segment/adaptive_threshold.h"
#include "recovery/imaging/segment/growing_front.h"

namespace angiospline {

using namespace region_growing;

namespace region_growing {

Result<void> check(const GrowOptions& o) {
  const auto bad = [](std::string what, std::string value, std::string rule) {
    return fail({ErrorKind::kBadInput, std::move(what), {}, std::move(value), std::move(rule)});
  };
  if (o.neighbourhood_vox < 3 || o.neighbourhood_vox > kMaxNeighbourhood ||
      o.neighbourhood_vox % 2 == 0)
    return bad("neighbourhood N is not usable", fmt::format("{}", o.neighbourhood_vox),
               fmt::format("N is odd, 3 to {}", kMaxNeighbourhood));
  if (!(o.deviations >= 0) || !std::isfinite(o.deviations))
    return bad("number of standard deviations M is not usable", fmt::format("{}", o.deviations),
               "M is 0 or more");
  if (!(o.smoothing_mm >= 0) || !std::isfinite(o.smoothing_mm))
    return bad("smoothing is not usable", fmt::format("{} mm", o.smoothing_mm), "0 or more");
  return {};
}

}  // namespace region_growing

namespace {

using Front = GrowingFront<Voxel>;

template <typename T>
class Grower {
 public:
  Grower(const Image<T>& image, const GrowOptions& options)
      : image_(image), options_(options), rule_(image, options) {}

  Result<void> start(const Vec3& seed_mm, std::size_t index) {
    const auto start = rule_.start(seed_mm, index);
    if (!start) return fail(start.error());
    report_.seeds.push_back(start->seed);
    for (const Voxel& v : start->voxels) label(v);
    for (const Voxel& v : start->voxels) queue_neighbours(v);
    return {};
  }

  Result<Segmentation> grow(const Progress& progress);

 private:
  void label(const Voxel& v) {
    rule_.label_vessel(v);
    ++labelled_;
  }
  void watch_front(const Front::Candidate& c);
  void close_basin();
  void queue_neighbours(const Voxel& v, double fading = 1);
  Decision decide(const Voxel& v);
  Segmentation finished();

  const Image<T>& image_;
  const GrowOptions& options_;
  AdaptiveThreshold<T> rule_;
  Front front_;
  GrowReport report_;
  double threshold_sum_ = 0;
  std::size_t labelled_ = 0;
  FrontLeap basin_;  // since the front last went darker
  double darkest_ = std::numeric_limits<double>::infinity();
};

template <typename T>
void Grower<T>::queue_neighbours(const Voxel& v, double fading) {
  for_each(box_around(v, 1, image_.grid.size), [&](const Voxel& n) {
    if (rule_.is_seen(n)) return;
    const double g = rule_.grey(n);
    if (!rule_.admissible(g, fading)) return;
    rule_.mark_seen(n);
    front_.push(g, n);
  });
}

template <typename T>
Decision Grower<T>::decide(const Voxel& v) {
  const Decision decision = rule_.decide(v);
  const double threshold = rule_.sign() * decision.threshold;
  if (report_.examined == 0) report_.threshold_min = report_.threshold_max = threshold;
  report_.threshold_min = std::min(report_.threshold_min, threshold);
  report_.threshold_max = std::max(report_.threshold_max, threshold);
  threshold_sum_ += threshold;
  ++report_.examined;
  return decision;
}

// The front takes the brightest voxel it touches: only behind a neck does it get brighter again.
template <typename T>
void Grower<T>::watch_front(const Front::Candidate& c) {
  if (c.grey >= darkest_) return;
  close_basin();
  darkest_ = c.grey;
  basin_ = {c.at, rule_.sign() * c.grey, labelled_, 0};
}

template <typename T>
void Grower<T>::close_basin() {
  using segmentation::kLeastLeap, segmentation::kLeastLeapShare;
  if (!std::isfinite(darkest_)) return;
  basin_.opened = labelled_ - basin_.before;
  if (basin_.opened >= std::max(kLeastLeap, basin_.before / kLeastLeapShare))
    report_.leaps.push_back(basin_);
}

template <typename T>
Segmentation Grower<T>::finished() {
  close_basin();
  Segmentation result{Mask(image_.grid), std::move(report_)};
  GrowReport& report = result.report;
  Moments grey_values;
  const double reference = rule_.grey(report.seeds.front());
  rule_.for_each_vessel([&](const Voxel& v) {
    result.mask[v] = 1;
    grey_values.add(rule_.grey(v) - reference);
  });
  report.voxels = grey_values.count;
  if (report.examined > 0)
    report.threshold_mean = threshold_sum_ / static_cast<double>(report.examined);
  report.vessel_mean = rule_.sign() * (reference + grey_values.mean());
  report.vessel_deviation = grey_values.deviation();
  return result;
}

template <typename T>
Result<Segmentation> Grower<T>::grow(const Progress& progress) {
  constexpr std::size_t kReportEvery = std::size_t{1} << 16;
  const auto examine = [&](const Front::Candidate& c) {
    if (rule_.is_vessel(c.at)) return;  // a later seed's start took it
    const Decision decision = decide(c.at);
    if (decision.vessel) {
      watch_front(c);
      label(c.at);
      queue_neighbours(c.at, decision.fading);
    } else {
      rule_.label_background(c.at);
    }
  };
  const Result<bool> limit_reached =
      front_.grow(report_.examined, options_.max_examined, kReportEvery, progress, examine);
  if (!limit_reached) return fail(limit_reached.error());
  report_.limit_reached = *limit_reached;
  return finished();
}

}  // namespace

double otsu_threshold(std::vector<double> values) {
  EXPECTS(!values.empty());
  std::sort(values.begin(), values.end());
  double total = 0;
  for (const double v : values) total += v - values.front();
  double below = 0, best = -1, threshold = values.front();
  for (std::size_t k = 1; k < values.size(); ++k) {
    below += values[k - 1] - values.front();
    if (values[k] == values[k - 1]) continue;
    const double n0 = static_cast<double>(k), n1 = static_cast<double>(values.size() - k);
    const double gap = below / n0 - (total - below) / n1;
    if (n0 * n1 * gap * gap > best) {
      best = n0 * n1 * gap * gap;
      threshold = values[k];
    }
  }
  return threshold;
}

template <typename T>
Result<Segmentation> grow_region(const Image<T>& image, const std::vector<Vec3>& seeds_mm,
                                 const GrowOptions& options, const Progress& progress) {
  EXPECTS(image.voxels.size() == image.grid.voxel_count());
  if (const auto ok = check(options); !ok) return fail(ok.error());
  if (seeds_mm.empty())
    return fail(
        {ErrorKind::kBadInput, "no seed", {}, {}, "region growing starts from at least one point"});
  Grower<T> grower(image, options);
  for (std::size_t i = 0; i < seeds_mm.size(); ++i)
    if (const auto started = grower.start(seeds_mm[i], i); !started) return fail(started.error());
  return grower.grow(progress);
}

Result<Segmentation> grow_region(const AnyImage& image, const std::vector<Vec3>& seeds_mm,
                                 const GrowOptions& options, const Progress& progress) {
  return std::visit([&](const auto& i) { return grow_region(i, seeds_mm, options, progress); },
                    image);
}

#define ANGIOSPLINE_INSTANTIATE(T)                                                     \
  template Result<Segmentation> grow_region(const Image<T>&, const std::vector<Vec3>&, \
                                            const GrowOptions&, const Progress&);
ANGIOSPLINE_FOR_PIXEL_TYPES(ANGIOSPLINE_INSTANTIATE)
#undef ANGIOSPLINE_INSTANTIATE

}  // namespace angiospline
