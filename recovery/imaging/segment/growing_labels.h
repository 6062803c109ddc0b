// What region growing knows of an image while it grows: labels, sums over the voxels labelled
// vessel, and grey values smoothed where they are asked for. Not installed.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "recovery/imaging/image/gaussian.h"
#include "recovery/imaging/image/image.h"
#include "recovery/imaging/segment/bricks.h"

namespace angiospline::region_growing {

struct Box {
  Voxel low, high;  // both inside the image
};

template <typename F>
void for_each(const Box& box, F&& f) {
  for (int z = box.low[2]; z <= box.high[2]; ++z)
    for (int y = box.low[1]; y <= box.high[1]; ++y)
      for (int x = box.low[0]; x <= box.high[0]; ++x) f(Voxel{x, y, z});
}

// The cube of edge 2 half + 1 around c, as far as it lies in the image.
inline Box box_around(const Voxel& c, int half, const Voxel& size) {
  Box box;
  for (std::size_t i = 0; i < 3; ++i) {
    box.low[i] = std::max(0, c[i] - half);
    box.high[i] = std::min(size[i] - 1, c[i] + half);
  }
  return box;
}

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

// One set of flags a voxel.
class VoxelFlags {
 public:
  enum Flag : std::uint8_t { kSeen = 1, kVessel = 2, kBackground = 4 };

  explicit VoxelFlags(const Voxel& size) : bricks_(size) {}

  // Whether any of the flags is set.
  bool any(const Voxel& v, unsigned flags) const {
    const Cube* cube = bricks_.find(v[0], v[1], v[2]);
    return cube != nullptr && (cube->flags[Store::within(v[0], v[1], v[2])] & flags) != 0;
  }
  void set(const Voxel& v, unsigned flags) {
    std::uint8_t& f = bricks_.touch(v[0], v[1], v[2]).flags[Store::within(v[0], v[1], v[2])];
    f = static_cast<std::uint8_t>(f | flags);
  }
  // f(voxel) wherever a flag is set, in an order of its own that is always the same.
  template <typename F>
  void for_each_with(Flag flag, F&& f) const {
    bricks_.for_each([&](const Voxel& low, const Cube& cube) {
      for (std::size_t i = 0; i < Store::kVoxels; ++i)
        if ((cube.flags[i] & flag) != 0)
          f(Voxel{low[0] + static_cast<int>(i % Store::kEdge),
                  low[1] + static_cast<int>(i / Store::kEdge % Store::kEdge),
                  low[2] + static_cast<int>(i / (Store::kEdge * Store::kEdge))});
    });
  }

 private:
  struct Cube {
    std::array<std::uint8_t, 512> flags{};
  };
  using Store = Bricks<Cube>;
  Store bricks_;
};

// Moments over the voxels labelled vessel in the box of edge 2 half + 1 around any voxel. Kept as
// the moments of runs of 2 half + 1 voxels along z: a label costs N additions, a box N^2.
class LabelledMoments {
 public:
  LabelledMoments(const Voxel& size, int half) : size_(size), half_(half), runs_(size) {}

  // Adds a voxel; every voxel at most once. The first one's grey value is the sums' reference.
  void add(const Voxel& v, double grey) {
    if (!reference_) reference_ = grey;
    const double d = grey - *reference_;
    const int end = std::min(size_[2] - 1, v[2] + half_);
    for (int z = std::max(0, v[2] - half_); z <= end;) {
      Cube& cube = runs_.touch(v[0], v[1], z);
      for (bool same = true; same && z <= end; same = (++z & (Store::kEdge - 1)) != 0) {
        const std::size_t i = Store::within(v[0], v[1], z);
        cube.sum[i] += d;
        cube.squares[i] += d * d;
        ++cube.count[i];
      }
    }
  }

  // About `reference()`.
  Moments around(const Voxel& v, const Box& box) const {
    Moments m;
    for (int y = box.low[1]; y <= box.high[1];) {
      const int y_end = std::min(box.high[1], y | (Store::kEdge - 1));
      for (int x = box.low[0]; x <= box.high[0];) {
        const int x_end = std::min(box.high[0], x | (Store::kEdge - 1));
        if (const Cube* cube = runs_.find(x, y, v[2]))
          add_runs(*cube, {x, y, v[2]}, x_end, y_end, m);
        x = x_end + 1;
      }
      y = y_end + 1;
    }
    return m;
  }
  double reference() const { return *reference_; }  // requires that a voxel was added

 private:
  struct Cube {
    std::array<double, 512> sum{}, squares{};
    std::array<std::uint8_t, 512> count{};
  };
  using Store = Bricks<Cube>;

  static void add_runs(const Cube& cube, const Voxel& from, int x_end, int y_end, Moments& m) {
    unsigned count = 0;
    for (int y = from[1]; y <= y_end; ++y) {
      const std::size_t row = Store::within(from[0], y, from[2]);
      const auto width = static_cast<std::size_t>(x_end - from[0] + 1);
      for (std::size_t i = row; i < row + width; ++i) {
        m.sum += cube.sum[i];
        m.sum_of_squares += cube.squares[i];
        count += cube.count[i];
      }
    }
    m.count += count;
  }

  Voxel size_;
  int half_;
  std::optional<double> reference_;
  Store runs_;
};

// The grey values of an image, smoothed where they are first asked for. Smoothed values are float
// whatever the image is: rounded to integers, ties in the queue and levels would follow the type.
template <typename T>
class GreyValues {
 public:
  GreyValues(const Image<T>& image, double smoothing_mm)
      : image_(image),
        smoothing_mm_(smoothing_mm),
        smooth_(smoothing_mm > 0 ? image.grid.size : Voxel{0, 0, 0}) {}

  double at(const Voxel& v) const {
    if (smoothing_mm_ == 0) return static_cast<double>(image_[v]);
    const Cube* cube = smooth_.find(v[0], v[1], v[2]);
    if (cube == nullptr) cube = &load(v);
    return static_cast<double>(cube->grey[Store::within(v[0], v[1], v[2])]);
  }

 private:
  struct Cube {
    std::array<float, 4096> grey;
  };
  using Store = Bricks<Cube, 4>;

  const Cube& load(const Voxel& v) const {
    Voxel low, high;
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = v[k] & ~(Store::kEdge - 1);
      high[k] = std::min(image_.grid.size[k] - 1, v[k] | (Store::kEdge - 1));
    }
    const Image<float> box = smoothed_box(image_, low, high, smoothing_mm_);
    Cube& cube = smooth_.touch(v[0], v[1], v[2]);
    std::size_t i = 0;
    for_each({low, high},
             [&](const Voxel& u) { cube.grey[Store::within(u[0], u[1], u[2])] = box.voxels[i++]; });
    return cube;
  }

  const Image<T>& image_;
  double smoothing_mm_;
  mutable Store smooth_;
};

}  // namespace angiospline::region_growing
