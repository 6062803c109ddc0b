#include "recovery/region_growing.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <queue>

#include <fmt/format.h>

namespace angiospline {
namespace {

constexpr int kMaxNeighbourhood = 15;

// One bit a voxel, rows padded to whole words, so that the labels of a row of a neighbourhood come
// with one or two loads.
class BitVolume {
 public:
  explicit BitVolume(const Voxel& size)
      : words_per_row_((static_cast<std::size_t>(size[0]) + 63) / 64 + 1),
        rows_(static_cast<std::size_t>(size[1])),
        words_(words_per_row_ * rows_ * static_cast<std::size_t>(size[2])) {}

  bool test(int x, int y, int z) const { return (word(x, y, z) >> (x & 63)) & 1U; }
  void set(int x, int y, int z) {
    words_[row(y, z) + static_cast<std::size_t>(x >> 6)] |= std::uint64_t{1} << (x & 63);
  }
  // Bits of `count` voxels from x on, the first in bit 0; count <= 32.
  std::uint32_t run(int x, int y, int z, int count) const {
    const std::size_t w = row(y, z) + static_cast<std::size_t>(x >> 6);
    const int shift = x & 63;
    std::uint64_t bits = words_[w] >> shift;
    if (shift + count > 64) bits |= words_[w + 1] << (64 - shift);
    return static_cast<std::uint32_t>(bits & ((std::uint64_t{1} << count) - 1));
  }

 private:
  std::size_t row(int y, int z) const {
    return words_per_row_ * (static_cast<std::size_t>(y) + rows_ * static_cast<std::size_t>(z));
  }
  std::uint64_t word(int x, int y, int z) const {
    return words_[row(y, z) + static_cast<std::size_t>(x >> 6)];
  }

  std::size_t words_per_row_;
  std::size_t rows_;
  std::vector<std::uint64_t> words_;
};

struct Box {
  Voxel low, high;  // both inside the image
};

struct Candidate {
  double grey;
  std::uint64_t order;  // of queueing: the tie rule
  Voxel at;
};
struct LaterInQueue {
  bool operator()(const Candidate& a, const Candidate& b) const {
    return a.grey != b.grey ? a.grey < b.grey : a.order > b.order;
  }
};

// Mean and standard deviation from sums about a reference value, so that equal values give exactly
// zero deviation.
struct Moments {
  std::size_t count = 0;
  double sum = 0, sum_of_squares = 0;

  void add(double difference) {
    ++count;
    sum += difference;
    sum_of_squares += difference * difference;
  }
  double mean() const { return sum / static_cast<double>(count); }
  double deviation() const {
    const double m = mean();
    return std::sqrt(std::max(0.0, sum_of_squares / static_cast<double>(count) - m * m));
  }
};

template <typename T>
class Grower {
 public:
  Grower(const Image<T>& image, const GrowOptions& options)
      : image_(image),
        options_(options),
        size_(image.grid.size),
        sign_(options.polarity == Polarity::kBright ? 1.0 : -1.0),
        floor_(options.background ? sign_ * *options.background
                                  : -std::numeric_limits<double>::infinity()),
        half_(options.neighbourhood_vox / 2),
        vessel_(size_),
        seen_(size_),
        rejected_(size_) {}

  Result<void> start(const Vec3& seed_mm, std::size_t index);
  Result<Segmentation> grow(const Progress& progress);

 private:
  // Grey value with vessels bright; not-a-number counts as darker than anything.
  double grey(const Voxel& v) const {
    const double value = static_cast<double>(image_[v]);
    if constexpr (std::is_floating_point_v<T>)
      if (!std::isfinite(value)) return -std::numeric_limits<double>::infinity();
    return sign_ * value;
  }
  bool admissible(double g) const { return g >= floor_ && std::isfinite(g); }

  Box box_around(const Voxel& c, int half) const {
    Box box;
    for (std::size_t i = 0; i < 3; ++i) {
      box.low[i] = std::max(0, c[i] - half);
      box.high[i] = std::min(size_[i] - 1, c[i] + half);
    }
    return box;
  }
  template <typename F>
  void for_each(const Box& box, F&& f) const {
    for (int z = box.low[2]; z <= box.high[2]; ++z)
      for (int y = box.low[1]; y <= box.high[1]; ++y)
        for (int x = box.low[0]; x <= box.high[0]; ++x) f(Voxel{x, y, z});
  }

  Voxel brightest_near(const Voxel& v) const;
  Moments labelled_around(const Box& box, double reference) const;
  double mean_of_brightest_connected(const Voxel& c, const Box& box) const;
  bool is_vessel(const Candidate& c);
  void label(const Voxel& v);
  void queue_neighbours(const Voxel& v);

  const Image<T>& image_;
  const GrowOptions& options_;
  Voxel size_;
  double sign_;
  double floor_;
  int half_;
  BitVolume vessel_;
  BitVolume seen_;      // queued, examined or vessel
  BitVolume rejected_;  // labelled background
  std::priority_queue<Candidate, std::vector<Candidate>, LaterInQueue> queue_;
  std::uint64_t order_ = 0;
  GrowReport report_;
  double threshold_sum_ = 0;
};

template <typename T>
Voxel Grower<T>::brightest_near(const Voxel& v) const {
  Voxel best = v;
  for_each(box_around(v, options_.seed_search_vox), [&](const Voxel& u) {
    if (grey(u) > grey(best)) best = u;
  });
  return best;
}

template <typename T>
void Grower<T>::label(const Voxel& v) {
  vessel_.set(v[0], v[1], v[2]);
  seen_.set(v[0], v[1], v[2]);
  ++report_.voxels;
}

template <typename T>
void Grower<T>::queue_neighbours(const Voxel& v) {
  const Box box = box_around(v, 1);
  for (int z = box.low[2]; z <= box.high[2]; ++z)
    for (int y = box.low[1]; y <= box.high[1]; ++y)
      for (int x = box.low[0]; x <= box.high[0]; ++x) {
        if (seen_.test(x, y, z)) continue;
        const double g = grey({x, y, z});
        if (!admissible(g)) continue;
        seen_.set(x, y, z);
        queue_.push({g, order_++, {x, y, z}});
      }
}

template <typename T>
Result<void> Grower<T>::start(const Vec3& seed_mm, std::size_t index) {
  const Vec3 at = image_.grid.index_vox(seed_mm);
  const Voxel clicked{static_cast<int>(std::lround(at[0])), static_cast<int>(std::lround(at[1])),
                      static_cast<int>(std::lround(at[2]))};
  const std::string where = fmt::format("seed {}", index + 1);
  const std::string place =
      fmt::format("({:.6g}, {:.6g}, {:.6g}) mm = voxel ({}, {}, {})", seed_mm[0], seed_mm[1],
                  seed_mm[2], clicked[0], clicked[1], clicked[2]);
  if (!seed_mm.allFinite() || !image_.grid.contains(clicked))
    return fail({ErrorKind::kBadInput, "seed is outside the image", where, place,
                 fmt::format("voxels go from (0, 0, 0) to ({}, {}, {}); world is LPS", size_[0] - 1,
                             size_[1] - 1, size_[2] - 1)});
  const Voxel seed = brightest_near(clicked);
  const double value = grey(seed);
  if (!admissible(value))
    return fail({ErrorKind::kBadInput, "no vessel at the seed", where,
                 fmt::format("{}, grey value {}", place, static_cast<double>(image_[clicked])),
                 std::isfinite(floor_)
                     ? fmt::format("the background goes to {:.6g}", *options_.background)
                     : std::string("the grey value must be finite")});
  const Box box = box_around(seed, half_);
  std::vector<double> values;
  for_each(box, [&](const Voxel& v) {
    if (std::isfinite(grey(v))) values.push_back(grey(v));
  });
  const double threshold = std::max(otsu_threshold(std::move(values)), floor_);
  if (value < threshold)
    return fail({ErrorKind::kBadInput, "no vessel at the seed", where,
                 fmt::format("{}, grey value {}", place, static_cast<double>(image_[clicked])),
                 fmt::format("the voxels around it split at {:.6g}", sign_ * threshold)});
  report_.seeds.push_back(seed);
  std::vector<Voxel> front{seed};
  if (!vessel_.test(seed[0], seed[1], seed[2])) label(seed);
  std::vector<Voxel> started{seed};
  for (std::size_t k = 0; k < started.size(); ++k) {
    Box near = box_around(started[k], 1);
    for (std::size_t i = 0; i < 3; ++i) {
      near.low[i] = std::max(near.low[i], box.low[i]);
      near.high[i] = std::min(near.high[i], box.high[i]);
    }
    for_each(near, [&](const Voxel& v) {
      if (grey(v) < threshold || vessel_.test(v[0], v[1], v[2])) return;
      label(v);
      started.push_back(v);
    });
  }
  for (const Voxel& v : started) queue_neighbours(v);
  return {};
}

template <typename T>
Moments Grower<T>::labelled_around(const Box& box, double reference) const {
  Moments s;
  const int width = box.high[0] - box.low[0] + 1;
  for (int z = box.low[2]; z <= box.high[2]; ++z)
    for (int y = box.low[1]; y <= box.high[1]; ++y) {
      std::uint32_t bits = vessel_.run(box.low[0], y, z, width);
      const std::size_t row = image_.grid.offset({box.low[0], y, z});
      for (; bits != 0; bits &= bits - 1)
        s.add(sign_ * static_cast<double>(
                          image_.voxels[row + static_cast<std::size_t>(std::countr_zero(bits))]) -
              reference);
    }
  return s;
}

// S2: from the candidate on, always the brightest unlabelled voxel that touches the set (ties: the
// one met first).
template <typename T>
double Grower<T>::mean_of_brightest_connected(const Voxel& c, const Box& box) const {
  const int wanted = options_.neighbourhood_vox / 2;
  struct Rim {
    double grey;
    Voxel at;
  };
  Rim rim[26 * (kMaxNeighbourhood / 2)];
  int rim_count = 0;
  std::uint16_t reached[kMaxNeighbourhood][kMaxNeighbourhood] = {};  // rows of bits: in set or rim
  const auto mark = [&](const Voxel& v) {
    std::uint16_t& row = reached[v[2] - box.low[2]][v[1] - box.low[1]];
    const auto bit = static_cast<std::uint16_t>(1U << (v[0] - box.low[0]));
    const bool fresh = (row & bit) == 0;
    row = static_cast<std::uint16_t>(row | bit);
    return fresh;
  };
  mark(c);
  Voxel last = c;
  // Sums of differences: a neighbourhood of equal values gives their mean exactly.
  const double reference = grey(c);
  double sum = 0;
  int count = 1;
  while (count < wanted) {
    for (int z = std::max(last[2] - 1, box.low[2]); z <= std::min(last[2] + 1, box.high[2]); ++z)
      for (int y = std::max(last[1] - 1, box.low[1]); y <= std::min(last[1] + 1, box.high[1]); ++y)
        for (int x = std::max(last[0] - 1, box.low[0]); x <= std::min(last[0] + 1, box.high[0]);
             ++x) {
          if (vessel_.test(x, y, z) || rejected_.test(x, y, z) || !mark({x, y, z})) continue;
          const double g = grey({x, y, z});
          if (std::isfinite(g)) rim[rim_count++] = {g, {x, y, z}};
        }
    if (rim_count == 0) break;
    Rim* best = std::max_element(rim, rim + rim_count,
                                 [](const Rim& a, const Rim& b) { return a.grey < b.grey; });
    sum += best->grey - reference;
    ++count;
    last = best->at;
    std::move(best + 1, rim + rim_count, best);  // keeps the order of meeting
    --rim_count;
  }
  return reference + sum / count;
}

template <typename T>
bool Grower<T>::is_vessel(const Candidate& c) {
  const Box box = box_around(c.at, half_);
  const Moments s1 = labelled_around(box, c.grey);
  const double mean = c.grey + s1.mean();
  const double threshold = mean - options_.deviations * s1.deviation();
  const double in_image = sign_ * threshold;
  if (report_.examined == 0) report_.threshold_min = report_.threshold_max = in_image;
  report_.threshold_min = std::min(report_.threshold_min, in_image);
  report_.threshold_max = std::max(report_.threshold_max, in_image);
  threshold_sum_ += in_image;
  ++report_.examined;
  if (options_.background_level) {
    // Where the edge of a vessel lies: half way, less where M is generous.
    constexpr double kSurely = 0.5, kHardly = 0.45;
    const double level = sign_ * *options_.background_level;
    if (c.grey >= level + kSurely * (mean - level)) return true;
    if (c.grey < level + kHardly * (mean - level)) return false;
  }
  return mean_of_brightest_connected(c.at, box) >= threshold;
}

template <typename T>
Result<Segmentation> Grower<T>::grow(const Progress& progress) {
  constexpr std::size_t kReportEvery = std::size_t{1} << 16;
  while (!queue_.empty()) {
    if (options_.max_examined && report_.examined >= *options_.max_examined) {
      report_.limit_reached = true;
      break;
    }
    if (report_.examined % kReportEvery == 0) {
      if (progress.should_stop()) return fail(cancelled("segment"));
      const double done = static_cast<double>(report_.examined);
      progress.at("segment", done / (done + static_cast<double>(queue_.size())));
    }
    const Candidate c = queue_.top();
    queue_.pop();
    if (vessel_.test(c.at[0], c.at[1], c.at[2])) continue;  // a later seed's start took it
    if (!is_vessel(c)) {
      rejected_.set(c.at[0], c.at[1], c.at[2]);
      continue;
    }
    label(c.at);
    queue_neighbours(c.at);
  }
  Segmentation result{Mask(image_.grid), std::move(report_)};
  Moments grey_values;
  const double reference = result.report.seeds.empty() ? 0 : grey(result.report.seeds.front());
  for_each({{0, 0, 0}, {size_[0] - 1, size_[1] - 1, size_[2] - 1}}, [&](const Voxel& v) {
    if (!vessel_.test(v[0], v[1], v[2])) return;
    result.mask[v] = 1;
    grey_values.add(grey(v) - reference);
  });
  GrowReport& report = result.report;
  if (report.examined > 0)
    report.threshold_mean = threshold_sum_ / static_cast<double>(report.examined);
  report.vessel_mean = sign_ * (reference + grey_values.mean());
  report.vessel_deviation = grey_values.deviation();
  progress.at("segment", 1);
  return result;
}

Result<void> check(const GrowOptions& o, const std::vector<Vec3>& seeds) {
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
  if (seeds.empty()) return bad("no seed", {}, "region growing starts from at least one point");
  return {};
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
  if (const auto ok = check(options, seeds_mm); !ok) return fail(ok.error());
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
ANGIOSPLINE_INSTANTIATE(std::uint8_t)
ANGIOSPLINE_INSTANTIATE(std::int8_t)
ANGIOSPLINE_INSTANTIATE(std::uint16_t)
ANGIOSPLINE_INSTANTIATE(std::int16_t)
ANGIOSPLINE_INSTANTIATE(std::uint32_t)
ANGIOSPLINE_INSTANTIATE(std::int32_t)
ANGIOSPLINE_INSTANTIATE(float)
ANGIOSPLINE_INSTANTIATE(double)
#undef ANGIOSPLINE_INSTANTIATE

}  // namespace angiospline
