#include "recovery/imaging/image/gaussian.h"

#include <algorithm>
#include <cmath>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "recovery/imaging/image/pixel_types.h"

namespace angiospline {
namespace {

// Weights of offsets 0, 1, ..., reach; the whole symmetric kernel sums to 1.
std::vector<float> half_kernel(double sigma_vox) {
  if (sigma_vox <= 0) return {1.0F};
  const int reach = std::max(1, static_cast<int>(std::ceil(3 * sigma_vox)));
  std::vector<double> w;
  double sum = 0;
  for (int k = 0; k <= reach; ++k) {
    w.push_back(std::exp(-0.5 * k * k / (sigma_vox * sigma_vox)));
    sum += (k == 0 ? 1 : 2) * w.back();
  }
  std::vector<float> out;
  for (const double x : w) out.push_back(static_cast<float>(x / sum));
  return out;
}

using Plane = std::vector<float>;

// out = in convolved along a row of `count` samples; `padded` is scratch of count + 2 * reach.
void convolve_row(const float* in, float* out, int count, const std::vector<float>& kernel,
                  std::vector<float>& padded) {
  const int reach = static_cast<int>(kernel.size()) - 1;
  padded.resize(static_cast<std::size_t>(count + 2 * reach));
  std::fill_n(padded.begin(), reach, in[0]);
  std::copy(in, in + count, padded.begin() + reach);
  std::fill_n(padded.begin() + reach + count, reach, in[count - 1]);
  const float* middle = padded.data() + reach;
  for (int x = 0; x < count; ++x) out[x] = kernel[0] * middle[x];
  for (int k = 1; k <= reach; ++k) {
    const float w = kernel[static_cast<std::size_t>(k)];
    for (int x = 0; x < count; ++x) out[x] += w * (middle[x - k] + middle[x + k]);
  }
}

// out[row] = sum over offsets of weight * rows[row + offset], rows clamped to [0, count).
template <typename RowAt>
void combine_rows(RowAt&& row_at, int at, int count, int width, const std::vector<float>& kernel,
                  float* out) {
  const float* centre = row_at(at);
  for (int x = 0; x < width; ++x) out[x] = kernel[0] * centre[x];
  for (int k = 1; k < static_cast<int>(kernel.size()); ++k) {
    const float* before = row_at(std::max(at - k, 0));
    const float* after = row_at(std::min(at + k, count - 1));
    const float w = kernel[static_cast<std::size_t>(k)];
    for (int x = 0; x < width; ++x) out[x] += w * (before[x] + after[x]);
  }
}

template <typename F>
void for_each_row(int rows, F&& f) {
  tbb::parallel_for(tbb::blocked_range<int>(0, rows, 16), [&](const tbb::blocked_range<int>& r) {
    std::vector<float> scratch;
    for (int y = r.begin(); y != r.end(); ++y) f(y, scratch);
  });
}

// Slices z of an image smoothed along x and y, kept for as long as the z kernel needs them.
template <typename T, typename Value>
class PlaneRing {
 public:
  PlaneRing(const Image<T>& image, Value value, const std::array<std::vector<float>, 3>& kernels)
      : image_(image), value_(value), kernels_(kernels), planes_(2 * kernels[2].size() - 1) {}

  const float* row(int y, int z) const {
    return planes_[slot(z)].data() + static_cast<std::size_t>(y) * width();
  }

  void load(int z) {
    Plane& plane = planes_[slot(z)];
    plane.resize(width() * static_cast<std::size_t>(image_.grid.size[1]));
    rows_.resize(plane.size());
    const int nx = image_.grid.size[0], ny = image_.grid.size[1];
    for_each_row(ny, [&](int y, std::vector<float>& scratch) {
      std::vector<float> values(width());
      const std::size_t first = image_.grid.offset({0, y, z});
      for (std::size_t x = 0; x < width(); ++x) values[x] = value_(image_.voxels[first + x]);
      convolve_row(values.data(), rows_.data() + static_cast<std::size_t>(y) * width(), nx,
                   kernels_[0], scratch);
    });
    for_each_row(ny, [&](int y, std::vector<float>&) {
      combine_rows([&](int r) { return rows_.data() + static_cast<std::size_t>(r) * width(); }, y,
                   ny, nx, kernels_[1], plane.data() + static_cast<std::size_t>(y) * width());
    });
  }

 private:
  std::size_t width() const { return static_cast<std::size_t>(image_.grid.size[0]); }
  std::size_t slot(int z) const { return static_cast<std::size_t>(z) % planes_.size(); }

  const Image<T>& image_;
  Value value_;
  const std::array<std::vector<float>, 3>& kernels_;
  std::vector<Plane> planes_;
  Plane rows_;
};

template <typename T>
T rounded(float x) {
  if constexpr (std::is_floating_point_v<T>)
    return static_cast<T>(x);
  else if constexpr (sizeof(T) <= 2)  // what lround gives for the values there are, and faster
    return static_cast<T>(static_cast<int>(x + std::copysign(0.5F, x)));
  else
    return static_cast<T>(std::lround(x));
}

// Convolves `value(voxel)` and hands every smoothed row to `store(first offset, row)`. A slice is
// loaded for good before the first row of its own slice is stored: storing in place is safe.
template <typename T, typename Value, typename Store>
void convolve(const Image<T>& image, const std::array<std::vector<float>, 3>& kernels, Value value,
              Store store) {
  const Voxel n = image.grid.size;
  const int reach = static_cast<int>(kernels[2].size()) - 1;
  PlaneRing ring(image, value, kernels);
  for (int z = 0; z < std::min(reach, n[2]); ++z) ring.load(z);
  for (int z = 0; z < n[2]; ++z) {
    if (z + reach < n[2]) ring.load(z + reach);
    for_each_row(n[1], [&](int y, std::vector<float>& out) {
      out.resize(static_cast<std::size_t>(n[0]));
      combine_rows([&](int r) { return ring.row(y, r); }, z, n[2], n[0], kernels[2], out.data());
      store(image.grid.offset({0, y, z}), out);
    });
  }
}

std::array<std::vector<float>, 3> kernels_of(const ImageGrid& grid, double sigma_mm) {
  std::array<std::vector<float>, 3> kernels;
  for (std::size_t i = 0; i < 3; ++i)
    kernels[i] = half_kernel(
        grid.size[i] > 1 ? sigma_mm / grid.spacing_mm[static_cast<Eigen::Index>(i)] : 0);
  return kernels;
}

template <typename T>
bool is_finite(T v) {
  if constexpr (std::is_floating_point_v<T>)
    return std::isfinite(v);
  else
    return true;
}

// A box of float values, and what convolving it without a border leaves of it.
struct Block {
  Voxel size;
  std::vector<float> values;
};

// Along one axis, whose extent falls by twice the kernel's reach. The same sums in the same order
// as convolve_row and combine_rows.
Block convolved(const Block& in, std::size_t axis, const std::vector<float>& kernel) {
  const auto reach = kernel.size() - 1;
  Block out{in.size, {}};
  out.size[axis] -= 2 * static_cast<int>(reach);
  const auto nx = static_cast<std::size_t>(in.size[0]), ny = static_cast<std::size_t>(in.size[1]);
  const std::size_t stride = axis == 0 ? 1 : axis == 1 ? nx : nx * ny;
  const auto width = static_cast<std::size_t>(out.size[0]);
  out.values.resize(width * static_cast<std::size_t>(out.size[1]) *
                    static_cast<std::size_t>(out.size[2]));
  float* to = out.values.data();
  for (std::size_t z = 0; z < static_cast<std::size_t>(out.size[2]); ++z)
    for (std::size_t y = 0; y < static_cast<std::size_t>(out.size[1]); ++y, to += width) {
      const float* centre = in.values.data() + nx * (y + ny * z) + reach * stride;
      for (std::size_t x = 0; x < width; ++x) to[x] = kernel[0] * centre[x];
      for (std::size_t k = 1; k <= reach; ++k) {
        const float w = kernel[k];
        const float *before = centre - k * stride, *after = centre + k * stride;
        for (std::size_t x = 0; x < width; ++x) to[x] += w * (before[x] + after[x]);
      }
    }
  return out;
}

}  // namespace

template <typename T>
Image<T> smoothed(Image<T> image, double sigma_mm) {
  EXPECTS(sigma_mm >= 0);
  if (sigma_mm == 0 || image.voxels.empty()) return image;
  const std::array<std::vector<float>, 3> kernels = kernels_of(image.grid, sigma_mm);

  if (std::all_of(image.voxels.begin(), image.voxels.end(), is_finite<T>)) {
    convolve(
        image, kernels, [](T v) { return static_cast<float>(v); },
        [&](std::size_t first, const std::vector<float>& row) {
          std::transform(row.begin(), row.end(),
                         image.voxels.begin() + static_cast<std::ptrdiff_t>(first), rounded<T>);
        });
    return image;
  }

  // Normalised convolution (Knutsson and Westin 1993): the share of finite voxels under the kernel
  // divides the sum over them.
  Image<float> share(image.grid);
  convolve(
      image, kernels, [](T v) { return is_finite(v) ? 1.0F : 0.0F; },
      [&](std::size_t first, const std::vector<float>& row) {
        std::copy(row.begin(), row.end(),
                  share.voxels.begin() + static_cast<std::ptrdiff_t>(first));
      });
  convolve(
      image, kernels, [](T v) { return is_finite(v) ? static_cast<float>(v) : 0.0F; },
      [&](std::size_t first, const std::vector<float>& row) {
        for (std::size_t x = 0; x < row.size(); ++x)
          if (is_finite(image.voxels[first + x]))
            image.voxels[first + x] = rounded<T>(row[x] / share.voxels[first + x]);
      });
  return image;
}

namespace {

// The values of a box that may reach beyond the image, where the border's goes on; 0 where they are
// not finite. `share`, of floating-point images, is 1 where they are, else 0.
struct FiniteBox {
  Block values, share;
  bool all_finite = true;
};

template <typename T>
FiniteBox finite_box(const Image<T>& image, const Voxel& first, const Voxel& size) {
  FiniteBox box;
  box.values.size = box.share.size = size;
  box.values.values.reserve(static_cast<std::size_t>(size[0]) * static_cast<std::size_t>(size[1]) *
                            static_cast<std::size_t>(size[2]));
  for (int z = 0; z < size[2]; ++z)
    for (int y = 0; y < size[1]; ++y)
      for (int x = 0; x < size[0]; ++x) {
        const T v = image[{std::clamp(first[0] + x, 0, image.grid.size[0] - 1),
                           std::clamp(first[1] + y, 0, image.grid.size[1] - 1),
                           std::clamp(first[2] + z, 0, image.grid.size[2] - 1)}];
        box.all_finite = box.all_finite && is_finite(v);
        box.values.values.push_back(is_finite(v) ? static_cast<float>(v) : 0.0F);
        if constexpr (std::is_floating_point_v<T>)
          box.share.values.push_back(is_finite(v) ? 1.0F : 0.0F);
      }
  return box;
}

}  // namespace

template <typename T>
Image<float> smoothed_box(const Image<T>& image, const Voxel& low, const Voxel& high,
                          double sigma_mm) {
  EXPECTS(sigma_mm >= 0 && image.grid.contains(low) && image.grid.contains(high));
  ImageGrid grid = image.grid;
  for (std::size_t k = 0; k < 3; ++k) grid.size[k] = high[k] - low[k] + 1;
  grid.origin_mm = image.grid.world_mm(low);
  Image<float> out(grid);
  const auto own = [&](std::size_t i) {
    const Voxel v = grid.voxel(i);
    return image[{low[0] + v[0], low[1] + v[1], low[2] + v[2]}];
  };
  if (sigma_mm == 0) {
    for (std::size_t i = 0; i < out.voxels.size(); ++i) out.voxels[i] = static_cast<float>(own(i));
    return out;
  }

  // Wider by the kernels' reach; each convolution takes its axis's margin away.
  const auto kernels = kernels_of(image.grid, sigma_mm);
  Voxel first, size;
  for (std::size_t k = 0; k < 3; ++k) {
    const int reach = static_cast<int>(kernels[k].size()) - 1;
    first[k] = low[k] - reach;
    size[k] = grid.size[k] + 2 * reach;
  }
  FiniteBox box = finite_box(image, first, size);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box.values = convolved(box.values, axis, kernels[axis]);
    if (!box.all_finite) box.share = convolved(box.share, axis, kernels[axis]);
  }
  if (box.all_finite) {
    out.voxels.assign(box.values.values.begin(), box.values.values.end());
    return out;
  }

  // Normalised convolution, as above.
  for (std::size_t i = 0; i < out.voxels.size(); ++i) {
    const T v = own(i);
    out.voxels[i] =
        is_finite(v) ? box.values.values[i] / box.share.values[i] : static_cast<float>(v);
  }
  return out;
}

Image<float> smoothed_box(const AnyImage& image, const Voxel& low, const Voxel& high,
                          double sigma_mm) {
  return std::visit([&](const auto& i) { return smoothed_box(i, low, high, sigma_mm); }, image);
}

AnyImage smoothed(AnyImage image, double sigma_mm) {
  return std::visit([&](auto&& i) { return AnyImage(smoothed(std::move(i), sigma_mm)); },
                    std::move(image));
}

#define ANGIOSPLINE_INSTANTIATE(T)              \
  template Image<T> smoothed(Image<T>, double); \
  template Image<float> smoothed_box(const Image<T>&, const Voxel&, const Voxel&, double);
ANGIOSPLINE_FOR_PIXEL_TYPES(ANGIOSPLINE_INSTANTIATE)
#undef ANGIOSPLINE_INSTANTIATE

}  // namespace angiospline
