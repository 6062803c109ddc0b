// A volume of which only the cubes that are touched exist. Not installed; for work that follows a
// vessel through an image.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

#include "recovery/imaging/image/image.h"

namespace angiospline {

// Cubes of 2^kShift voxels a side, each with a `Content`. Memory: 4 bytes a cube of the whole
// volume, and the contents of those touched; they stay where they are.
template <typename Content, unsigned kShift = 3>
class Bricks {
 public:
  static constexpr int kEdge = 1 << kShift;
  static constexpr std::size_t kVoxels = std::size_t{1} << (3 * kShift);

  explicit Bricks(const Voxel& size) {
    std::size_t bricks = 1;
    for (std::size_t k = 0; k < 3; ++k) {
      count_[k] = static_cast<std::size_t>((size[k] + kEdge - 1) >> kShift);
      bricks *= count_[k];
    }
    number_.assign(bricks, 0);
  }

  // Where a voxel lies within its cube, x fastest.
  static std::size_t within(int x, int y, int z) {
    constexpr int kMask = kEdge - 1;
    return static_cast<std::size_t>((x & kMask) | (y & kMask) << kShift |
                                    (z & kMask) << (2 * kShift));
  }

  // The cube that holds a voxel of the volume; null if it was never touched.
  const Content* find(int x, int y, int z) const {
    const std::uint32_t n = number_[index(x, y, z)];
    return n == 0 ? nullptr : &contents_[n - 1];
  }

  Content& touch(int x, int y, int z) {
    std::uint32_t& n = number_[index(x, y, z)];
    if (n == 0) {
      contents_.emplace_back();
      n = static_cast<std::uint32_t>(contents_.size());
    }
    return contents_[n - 1];
  }

  // f(lowest voxel, content) for every cube touched, in the order of the volume.
  template <typename F>
  void for_each(F&& f) const {
    for (std::size_t i = 0; i < number_.size(); ++i) {
      if (number_[i] == 0) continue;
      const auto at = [](std::size_t k) { return static_cast<int>(k) * kEdge; };
      f(Voxel{at(i % count_[0]), at(i / count_[0] % count_[1]), at(i / (count_[0] * count_[1]))},
        contents_[number_[i] - 1]);
    }
  }

 private:
  std::size_t index(int x, int y, int z) const {
    return static_cast<std::size_t>(x >> kShift) +
           count_[0] * (static_cast<std::size_t>(y >> kShift) +
                        count_[1] * static_cast<std::size_t>(z >> kShift));
  }

  std::array<std::size_t, 3> count_{};
  std::vector<std::uint32_t> number_;  // of the cube's content, from 1; 0: none
  std::deque<Content> contents_;
};

}  // namespace angiospline
