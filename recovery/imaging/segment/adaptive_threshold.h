// The rule of region growing for one image: its labels, and whether a voxel is vessel (thesis 4.1).
// Not installed; shared by growing in one image and in several.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "base/result.h"
#include "recovery/imaging/segment/growing_labels.h"
#include "recovery/imaging/segment/region_growing.h"
#include "recovery/imaging/segment/rules.h"

namespace angiospline::region_growing {

constexpr int kMaxNeighbourhood = 15;

inline Voxel nearest_voxel(const Vec3& index_vox) {
  return {static_cast<int>(std::lround(index_vox[0])), static_cast<int>(std::lround(index_vox[1])),
          static_cast<int>(std::lround(index_vox[2]))};
}

struct Decision {
  bool vessel;
  double threshold;   // grey value with vessels bright
  double fading = 1;  // of the signal here against that of the options' levels
};

// Error for options that no growing can use.
Result<void> check(const GrowOptions& options);

template <typename T>
class AdaptiveThreshold {
 public:
  // Keeps references to both; the image's values may change between calls.
  AdaptiveThreshold(const Image<T>& image, const GrowOptions& options)
      : image_(image),
        values_(image, options.smoothing_mm),
        options_(options),
        size_(image.grid.size),
        sign_(options.polarity == Polarity::kBright ? 1.0 : -1.0),
        floor_(options.background ? sign_ * *options.background
                                  : -std::numeric_limits<double>::infinity()),
        half_(options.neighbourhood_vox / 2),
        labels_(size_),
        labelled_(size_, half_) {}

  double sign() const { return sign_; }
  double floor() const { return floor_; }

  // Grey value with vessels bright; not-a-number counts as darker than anything.
  double grey(const Voxel& v) const {
    const double value = values_.at(v);
    if constexpr (std::is_floating_point_v<T>)
      if (!std::isfinite(value)) return -std::numeric_limits<double>::infinity();
    return sign_ * value;
  }
  bool admissible(double g, double fading = 1) const {
    return g >= fading * floor_ && std::isfinite(g);
  }

  bool is_vessel(const Voxel& v) const { return labels_.any(v, VoxelFlags::kVessel); }
  template <typename F>
  void for_each_vessel(F&& f) const {
    labels_.for_each_with(VoxelFlags::kVessel, f);
  }
  // The voxel's grey value must not change any more.
  void label_vessel(const Voxel& v) {
    if (is_vessel(v)) return;
    labels_.set(v, VoxelFlags::kVessel | VoxelFlags::kSeen);
    if (const double g = grey(v); std::isfinite(g)) labelled_.add(v, g);
  }
  void label_background(const Voxel& v) { labels_.set(v, VoxelFlags::kBackground); }
  // A mark for the caller's use; a label of vessel sets it too.
  bool is_seen(const Voxel& v) const { return labels_.any(v, VoxelFlags::kSeen); }
  void mark_seen(const Voxel& v) { labels_.set(v, VoxelFlags::kSeen); }

  Decision decide(const Voxel& v) const;

  // Where growing starts near a clicked point, and the voxels of S1 there; they are not labelled
  // yet.
  struct Start {
    Voxel seed;
    std::vector<Voxel> voxels;
  };
  Result<Start> start(const Vec3& seed_mm, std::size_t index) const;

 private:
  Voxel brightest_near(const Voxel& v) const;
  double fading(double s1_mean, std::size_t s1_count, const Box& box) const;
  double mean_of_brightest_connected(const Voxel& c, const Box& box) const;

  const Image<T>& image_;
  GreyValues<T> values_;
  const GrowOptions& options_;
  Voxel size_;
  double sign_;
  double floor_;
  int half_;
  VoxelFlags labels_;  // background: compared and found dark; a later label of vessel overrules it
  LabelledMoments labelled_;
};

template <typename T>
Voxel AdaptiveThreshold<T>::brightest_near(const Voxel& v) const {
  Voxel best = v;
  for_each(box_around(v, options_.seed_search_vox, size_), [&](const Voxel& u) {
    if (grey(u) > grey(best)) best = u;
  });
  return best;
}

// S2: from the candidate on, always the brightest unlabelled voxel that touches the set (ties: the
// one met first).
template <typename T>
double AdaptiveThreshold<T>::mean_of_brightest_connected(const Voxel& c, const Box& box) const {
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
          if (labels_.any({x, y, z}, VoxelFlags::kVessel | VoxelFlags::kBackground) ||
              !mark({x, y, z}))
            continue;
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

// How much darker the vessel is here than at the seeds: 1 where it is thinner than the
// neighbourhood, since there the edges' partial volume would be taken for a fading signal.
template <typename T>
double AdaptiveThreshold<T>::fading(double s1_mean, std::size_t s1_count, const Box& box) const {
  using namespace segmentation;
  if (!options_.vessel_level || !options_.background_level) return 1;
  if (sign_ < 0 || *options_.background_level < 0 || !(*options_.vessel_level > 0)) return 1;
  std::size_t volume = 1;
  for (std::size_t k = 0; k < 3; ++k)
    volume *= static_cast<std::size_t>(box.high[k] - box.low[k] + 1);
  if (static_cast<double>(s1_count) < kThick * static_cast<double>(volume)) return 1;
  return std::clamp(s1_mean / (kEdges * *options_.vessel_level), kLeastFading, 1.0);
}

template <typename T>
Decision AdaptiveThreshold<T>::decide(const Voxel& v) const {
  const Box box = box_around(v, half_, size_);
  const double here = grey(v);
  const Moments s1 = labelled_.around(v, box);
  if (s1.count == 0) return {false, std::numeric_limits<double>::infinity()};
  const double mean = labelled_.reference() + s1.mean();
  const double threshold = mean - options_.deviations * s1.deviation();
  const double faded = fading(mean, s1.count, box);
  if (options_.background_level) {
    // Where the edge of a vessel lies: half way, less where M is generous.
    using segmentation::kHardly, segmentation::kSurely;
    const double level = faded * sign_ * *options_.background_level;
    if (here >= level + kSurely * (mean - level)) return {true, threshold, faded};
    if (here < level + kHardly * (mean - level)) return {false, threshold, faded};
  }
  return {mean_of_brightest_connected(v, box) >= threshold, threshold, faded};
}

template <typename T>
auto AdaptiveThreshold<T>::start(const Vec3& seed_mm, std::size_t index) const -> Result<Start> {
  const Voxel clicked = nearest_voxel(image_.grid.index_vox(seed_mm));
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

  // S1 begins on the seed's side of the two classes that the box falls into (Otsu 1979),
  const Box box = box_around(seed, half_, size_);
  std::vector<double> values;
  for_each(box, [&](const Voxel& v) {
    if (std::isfinite(grey(v))) values.push_back(grey(v));
  });
  const double threshold = std::max(otsu_threshold(std::move(values)), floor_);
  if (value < threshold)
    return fail({ErrorKind::kBadInput, "no vessel at the seed", where,
                 fmt::format("{}, grey value {}", place, static_cast<double>(image_[clicked])),
                 fmt::format("the voxels around it split at {:.6g}", sign_ * threshold)});

  // as far as it is connected to the seed within the box.
  Start out{seed, {seed}};
  Mask taken;
  for (std::size_t i = 0; i < 3; ++i) taken.grid.size[i] = box.high[i] - box.low[i] + 1;
  taken.voxels.assign(taken.grid.voxel_count(), 0);
  const auto take = [&](const Voxel& v) {
    auto& t = taken[{v[0] - box.low[0], v[1] - box.low[1], v[2] - box.low[2]}];
    return std::exchange(t, std::uint8_t{1}) == 0;
  };
  take(seed);
  for (std::size_t k = 0; k < out.voxels.size(); ++k) {
    Box near = box_around(out.voxels[k], 1, size_);
    for (std::size_t i = 0; i < 3; ++i) {
      near.low[i] = std::max(near.low[i], box.low[i]);
      near.high[i] = std::min(near.high[i], box.high[i]);
    }
    for_each(near, [&](const Voxel& v) {
      if (grey(v) >= threshold && take(v)) out.voxels.push_back(v);
    });
  }
  return out;
}

}  // namespace angiospline::region_growing
