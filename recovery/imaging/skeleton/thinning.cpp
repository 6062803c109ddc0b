#include "recovery/imaging/skeleton/thinning.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <deque>
#include <limits>
#include <numbers>
#include <optional>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "recovery/imaging/mask/distance_transform.h"

namespace angiospline {
namespace {

// What a foreground voxel's byte holds while the image is being thinned; background is 0.
constexpr std::uint8_t kForeground = 1;
constexpr std::uint8_t kBoundary = 2;  // has background on a face
constexpr std::uint8_t kWaiting = 4;   // is in a list, to be looked at
constexpr std::uint8_t kRim = 8;       // so close to the image's border that reads need care
constexpr std::uint8_t kKept = 16;     // is never removed

constexpr std::size_t kWorthThreads = 1 << 13;

// Subfield of a voxel: the parities of its coordinates. Two voxels of one subfield never touch.
unsigned subfield(const Voxel& v) {
  return static_cast<unsigned>((v[0] & 1) | (v[1] & 1) << 1 | (v[2] & 1) << 2);
}

template <typename Offset>
class Thinner {
 public:
  Thinner(Mask& mask, Connectivity connectivity, bool keeps_end_points)
      : mask_(mask), connectivity_(connectivity), keeps_end_points_(keeps_end_points) {
    const auto nx = static_cast<std::ptrdiff_t>(mask.grid.size[0]);
    const auto nxy = nx * mask.grid.size[1];
    for (unsigned k = 0; k < 26; ++k) {
      const Voxel& d = kNeighbors[k];
      strides_[k] = d[0] + nx * d[1] + nxy * d[2];
      flips_[k] = subfield(d);
    }
    for (int z = -1; z <= 1; ++z)
      for (int y = -1; y <= 1; ++y)
        rows_[static_cast<unsigned>(4 + y + 3 * z)] = nx * y + nxy * z - 1;
  }

  // Distances decide the layer in which a voxel may go first: its distance in steps of `step`.
  void order_by_distance(const ForegroundDistances& distances_mm, double step_mm) {
    distances_mm_ = &distances_mm;
    step_mm_ = step_mm;
  }

  // Flags every foreground voxel and lists the boundary.
  void find_boundary() {
    const Voxel& n = mask_.grid.size;
    const auto width = static_cast<std::size_t>(n[0]);
    for (int z = 0; z < n[2]; ++z)
      for (int y = 0; y < n[1]; ++y) {
        const std::size_t row = mask_.grid.offset({0, y, z});
        const std::uint8_t* values = mask_.voxels.data() + row;
        for (std::size_t x = 0; (x = next_foreground(values, x, width)) < width; ++x)
          admit({static_cast<int>(x), y, z}, row + x);
      }
  }

  // The same for a list of voxels; the image around them must already be 0 and 1.
  void find_boundary(const std::vector<std::size_t>& voxels) {
    for (const std::size_t offset : voxels)
      if (mask_.voxels[offset] != 0) admit(mask_.grid.voxel(offset), offset);
  }

  void keep(const std::vector<std::size_t>& voxels) {
    for (const std::size_t offset : voxels)
      if (mask_.voxels[offset] != 0) mask_.voxels[offset] |= kKept;
  }

  // Layer after layer until nothing waits. False if stopped.
  bool run(const Progress& progress) {
    for (; !layers_.empty(); layers_.pop_front(), ++layer_) {
      if (progress.should_stop()) return false;
      progress.at("thin",
                  listed_ == 0 ? 1.0 : static_cast<double>(seen_) / static_cast<double>(listed_));
      for (unsigned s = 0; s < 8; ++s) {
        Lists& lists = layers_.front();
        thin_subfield(lists[s], s);
        seen_ += lists[s].size();
        std::vector<Offset>().swap(lists[s]);
      }
    }
    return true;
  }

 private:
  using Lists = std::array<std::vector<Offset>, 8>;

  std::uint8_t& state(std::size_t offset) { return mask_.voxels[offset]; }

  void admit(const Voxel& v, std::size_t offset) {
    const Voxel& n = mask_.grid.size;
    // Rows are read four bytes at a time, so the last but one column needs care too.
    const bool rim = v[0] == 0 || v[1] == 0 || v[2] == 0 || v[0] >= n[0] - 2 || v[1] == n[1] - 1 ||
                     v[2] == n[2] - 1;
    std::uint8_t& s = state(offset);
    s = static_cast<std::uint8_t>(kForeground | (rim ? kRim : 0));
    for (unsigned k = 0; k < kFaceNeighbors; ++k) {
      const Voxel u{v[0] + kNeighbors[k][0], v[1] + kNeighbors[k][1], v[2] + kNeighbors[k][2]};
      if ((!rim || mask_.grid.contains(u)) && state(neighbor(offset, k)) != 0) continue;
      s |= kBoundary;
      wait(offset, subfield(v), 0);
      return;
    }
  }

  std::size_t neighbor(std::size_t offset, unsigned k) const {
    return offset + static_cast<std::size_t>(strides_[k]);  // wraps to a subtraction
  }

  // Puts a boundary voxel into the list of the layer in which it is looked at next.
  void wait(std::size_t offset, unsigned field, std::size_t earliest) {
    std::size_t layer = earliest;
    if (distances_mm_) {
      const double steps = distances_mm_->at_mm(offset) / step_mm_;
      const auto own = static_cast<std::size_t>(std::max(0.0, std::ceil(steps) - 1.0));
      layer = std::max(earliest, own > layer_ ? own - layer_ : 0);
    }
    if (layers_.size() <= layer) layers_.resize(layer + 1);
    layers_[layer][field].push_back(static_cast<Offset>(offset));
    state(offset) |= kWaiting;
    ++listed_;
  }

  Block block(std::size_t offset) const {
    const std::uint8_t* centre = mask_.voxels.data() + offset;
    if (*centre & kRim) return block_around(mask_, mask_.grid.voxel(offset));
    Block bits = 0;
    for (unsigned row = 0; row < 9; ++row) {
      std::uint32_t four = 0;
      std::memcpy(&four, centre + rows_[row], sizeof four);
      // Bits 0, 8 and 16 of the product's factor come together at 16, 17 and 18.
      bits |= ((four & 0x00010101U) * 0x00010204U >> 16 & 7U) << (3 * row);
    }
    return bits;
  }

  bool may_go(std::size_t offset) const {
    if (mask_.voxels[offset] & kKept) return false;
    const Block b = block(offset);
    if (keeps_end_points_ && is_end_point(b, connectivity_)) return false;
    return is_simple(b, connectivity_);
  }

  // Voxels of one subfield do not touch, so each can be judged without regard to the others.
  void thin_subfield(const std::vector<Offset>& list, unsigned field) {
    for (const Offset offset : list) state(offset) &= static_cast<std::uint8_t>(~kWaiting);
    if (list.size() < kWorthThreads) {
      for (const Offset offset : list)
        if (may_go(offset)) remove(offset, field);
      return;
    }
    verdicts_.resize(list.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, list.size(), kWorthThreads / 4),
                      [&](const tbb::blocked_range<std::size_t>& range) {
                        for (std::size_t i = range.begin(); i < range.end(); ++i)
                          verdicts_[i] = may_go(list[i]) ? 1 : 0;
                      });
    for (std::size_t i = 0; i < list.size(); ++i)
      if (verdicts_[i] != 0) remove(list[i], field);
  }

  void remove(std::size_t offset, unsigned field) {
    const bool rim = (state(offset) & kRim) != 0;
    const Voxel v = rim ? mask_.grid.voxel(offset) : Voxel{};
    state(offset) = 0;
    for (unsigned k = 0; k < 26; ++k) {
      if (rim) {
        const Voxel& d = kNeighbors[k];
        if (!mask_.grid.contains({v[0] + d[0], v[1] + d[1], v[2] + d[2]})) continue;
      }
      const std::size_t u = neighbor(offset, k);
      std::uint8_t& s = state(u);
      if (s == 0) continue;
      if (k < kFaceNeighbors) s |= kBoundary;
      if ((s & (kBoundary | kWaiting | kKept)) == kBoundary) wait(u, field ^ flips_[k], 1);
    }
  }

  Mask& mask_;
  Connectivity connectivity_;
  bool keeps_end_points_;
  const ForegroundDistances* distances_mm_ = nullptr;
  double step_mm_ = 1.0;
  std::array<std::ptrdiff_t, 26> strides_{};
  std::array<unsigned, 26> flips_{};
  std::array<std::ptrdiff_t, 9> rows_{};
  std::deque<Lists> layers_;  // the front is the layer being thinned
  std::size_t layer_ = 0;     // number of the front layer
  std::size_t listed_ = 0;
  std::size_t seen_ = 0;
  std::vector<std::uint8_t> verdicts_;
};

void to_zero_and_one(Mask& mask) {
  for (std::uint8_t& v : mask.voxels) v = v != 0 ? 1 : 0;
}

template <typename Offset>
Result<Mask> thin_with(Mask mask, const ThinningOptions& options, const Progress& progress) {
  std::optional<ForegroundDistances> distances_mm;
  Thinner<Offset> thinner(mask, options.connectivity, true);
  if (options.order == ThinningOrder::kDistance) {
    distances_mm.emplace(mask);
    // Fine enough that no voxel's layer comes after the one in which its turn would come by faces.
    thinner.order_by_distance(*distances_mm, mask.grid.spacing_mm.minCoeff() / std::numbers::sqrt3);
  }
  thinner.find_boundary();
  if (!thinner.run(progress)) return fail(cancelled("thin"));
  to_zero_and_one(mask);
  return mask;
}

}  // namespace

Result<Mask> thin(Mask mask, const ThinningOptions& options, const Progress& progress) {
  EXPECTS(mask.voxels.size() == mask.grid.voxel_count());
  return mask.voxels.size() <= std::numeric_limits<std::uint32_t>::max()
             ? thin_with<std::uint32_t>(std::move(mask), options, progress)
             : thin_with<std::uint64_t>(std::move(mask), options, progress);
}

void rethin(Mask& mask, const std::vector<std::size_t>& voxels,
            const std::vector<std::size_t>& kept, Connectivity connectivity) {
  Thinner<std::uint64_t> thinner(mask, connectivity, false);
  thinner.find_boundary(voxels);
  thinner.keep(kept);
  thinner.run({});
  for (const std::size_t offset : voxels)
    if (mask.voxels[offset] != 0) mask.voxels[offset] = kForeground;
  for (const std::size_t offset : kept)
    if (mask.voxels[offset] != 0) mask.voxels[offset] = kForeground;
}

}  // namespace angiospline
