#include "recovery/distance_transform.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

namespace angiospline {
namespace {

constexpr float kFar = std::numeric_limits<float>::infinity();
constexpr int kColumns = 16;  // columns read together: one cache line of float

// Room for one pass over a line of n samples.
struct Line {
  explicit Line(int n)
      : value(static_cast<std::size_t>(n)),
        apex(static_cast<std::size_t>(n)),
        from(static_cast<std::size_t>(n)) {}
  std::vector<float> value;
  std::vector<int> apex;     // of the parabolas of the lower envelope
  std::vector<double> from;  // where each begins to be the lowest
};

// value[i] becomes min over j of value[j] + (step (i - j))^2, by the lower envelope of parabolas.
void transform(Line& line, double step) {
  const auto n = static_cast<int>(line.value.size());
  const auto f = [&](int i) {
    return static_cast<double>(line.value[static_cast<std::size_t>(i)]);
  };
  const double step2 = step * step;
  int top = -1;
  for (int i = 0; i < n; ++i) {
    if (f(i) == static_cast<double>(kFar)) continue;
    double begin = -std::numeric_limits<double>::infinity();
    while (top >= 0) {
      const int j = line.apex[static_cast<std::size_t>(top)];
      begin = 0.5 * ((f(i) - f(j)) / (step2 * (i - j)) + i + j);
      if (begin > line.from[static_cast<std::size_t>(top)]) break;
      --top;
    }
    if (top < 0) begin = -std::numeric_limits<double>::infinity();
    ++top;
    line.apex[static_cast<std::size_t>(top)] = i;
    line.from[static_cast<std::size_t>(top)] = begin;
  }
  if (top < 0) return;
  // A parabola's value is read before it is overwritten: the apexes' values are kept aside.
  std::vector<double> apex_value(static_cast<std::size_t>(top) + 1);
  for (int k = 0; k <= top; ++k)
    apex_value[static_cast<std::size_t>(k)] = f(line.apex[static_cast<std::size_t>(k)]);
  int k = 0;
  for (int i = 0; i < n; ++i) {
    while (k < top && line.from[static_cast<std::size_t>(k) + 1] < i) ++k;
    const double d = step * (i - line.apex[static_cast<std::size_t>(k)]);
    line.value[static_cast<std::size_t>(i)] =
        static_cast<float>(d * d + apex_value[static_cast<std::size_t>(k)]);
  }
}

// Transforms all lines along `axis` (1 or 2) of squared distances, kColumns of them at a time.
void transform_axis(Image<float>& squared, int axis) {
  const Voxel n = squared.grid.size;
  const auto a = static_cast<std::size_t>(axis);
  const int other = axis == 1 ? n[2] : n[1];
  const int length = n[a];
  const std::size_t stride = axis == 1
                                 ? static_cast<std::size_t>(n[0])
                                 : static_cast<std::size_t>(n[0]) * static_cast<std::size_t>(n[1]);
  tbb::parallel_for(tbb::blocked_range<int>(0, other), [&](const tbb::blocked_range<int>& range) {
    std::vector<Line> lines(kColumns, Line(length));
    for (int o = range.begin(); o < range.end(); ++o)
      for (int x0 = 0; x0 < n[0]; x0 += kColumns) {
        const int columns = std::min(kColumns, n[0] - x0);
        float* base = &squared[axis == 1 ? Voxel{x0, 0, o} : Voxel{x0, o, 0}];
        bool any = false;
        for (int i = 0; i < length; ++i)
          for (int c = 0; c < columns; ++c) {
            const float v =
                base[static_cast<std::size_t>(i) * stride + static_cast<std::size_t>(c)];
            lines[static_cast<std::size_t>(c)].value[static_cast<std::size_t>(i)] = v;
            any = any || v != 0.0F;
          }
        if (!any) continue;
        for (int c = 0; c < columns; ++c)
          transform(lines[static_cast<std::size_t>(c)], squared.grid.spacing_mm[axis]);
        for (int i = 0; i < length; ++i)
          for (int c = 0; c < columns; ++c)
            base[static_cast<std::size_t>(i) * stride + static_cast<std::size_t>(c)] =
                lines[static_cast<std::size_t>(c)].value[static_cast<std::size_t>(i)];
      }
  });
}

// Squared distances along x alone.
void transform_rows(const Mask& mask, Image<float>& squared) {
  const Voxel n = mask.grid.size;
  const double step = mask.grid.spacing_mm[0];
  tbb::parallel_for(tbb::blocked_range<int>(0, n[2]), [&](const tbb::blocked_range<int>& range) {
    for (int z = range.begin(); z < range.end(); ++z)
      for (int y = 0; y < n[1]; ++y) {
        const std::uint8_t* in = &mask.voxels[mask.grid.offset({0, y, z})];
        float* out = &squared.voxels[mask.grid.offset({0, y, z})];
        int last = -1;  // the last background voxel passed
        for (int x = 0; x < n[0]; ++x) {
          if (in[x] == 0) last = x;
          const double d = step * (x - last);
          out[x] = last < 0 ? kFar : static_cast<float>(d * d);
        }
        last = -1;
        for (int x = n[0] - 1; x >= 0; --x) {
          if (in[x] == 0) last = x;
          const double d = step * (last - x);
          if (last >= 0) out[x] = std::min(out[x], static_cast<float>(d * d));
        }
      }
  });
}

// An image without background: the distance to the nearest voxel outside.
void distances_to_outside_mm(Image<float>& distances) {
  const ImageGrid& g = distances.grid;
  for (std::size_t i = 0; i < distances.voxels.size(); ++i) {
    const Voxel v = g.voxel(i);
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t a = 0; a < 3; ++a)
      least = std::min(least, g.spacing_mm[static_cast<Eigen::Index>(a)] *
                                  (1 + std::min(v[a], g.size[a] - 1 - v[a])));
    distances.voxels[i] = static_cast<float>(least);
  }
}

// The first octant of a ball, nearest first, grown on demand; the other octants are reflections.
class Shells {
 public:
  explicit Shells(const ImageGrid& grid) : grid_(grid) {
    grow_to(4.0 * grid.spacing_mm.maxCoeff());
  }

  struct Entry {
    double distance_mm;
    double to_boundary_mm;
    Voxel d;
  };

  // The entry at which to begin so that none nearer than `distance_mm` follows.
  std::size_t first_at(double distance_mm) {
    while (radius_mm_ < distance_mm) grow_to(2.0 * radius_mm_);
    return static_cast<std::size_t>(
        std::lower_bound(entries_.begin(), entries_.end(), distance_mm,
                         [](const Entry& e, double d) { return e.distance_mm < d; }) -
        entries_.begin());
  }

  // Entry i, or nothing if the ball holds the whole image.
  const Entry* at(std::size_t i) {
    while (i >= entries_.size()) {
      if (radius_mm_ > diagonal_mm()) return nullptr;
      grow_to(2.0 * radius_mm_);
    }
    return &entries_[i];
  }

 private:
  double diagonal_mm() const {
    const Vec3 size(grid_.size[0], grid_.size[1], grid_.size[2]);
    return size.cwiseProduct(grid_.spacing_mm).norm();
  }

  void grow_to(double radius_mm) {
    radius_mm_ = radius_mm;
    entries_.clear();
    std::array<int, 3> most{};
    for (std::size_t a = 0; a < 3; ++a)
      most[a] =
          std::min(grid_.size[a] - 1,
                   static_cast<int>(radius_mm / grid_.spacing_mm[static_cast<Eigen::Index>(a)]));
    for (int z = 0; z <= most[2]; ++z)
      for (int y = 0; y <= most[1]; ++y)
        for (int x = 0; x <= most[0]; ++x) {
          const Vec3 steps(x, y, z);
          const double d = steps.cwiseProduct(grid_.spacing_mm).norm();
          if (d > 0.0 &&
              d <= radius_mm)  // steps.norm() voxels long, so half a voxel is d / 2 / norm
            entries_.push_back({d, d * (1.0 - 0.5 / steps.norm()), {x, y, z}});
        }
    std::stable_sort(entries_.begin(), entries_.end(),
                     [](const Entry& a, const Entry& b) { return a.distance_mm < b.distance_mm; });
  }

  ImageGrid grid_;
  double radius_mm_ = 0.0;
  std::vector<Entry> entries_;
};

bool reaches_background(const Mask& mask, const Voxel& v, const Voxel& d) {
  for (int sign = 0; sign < 8; ++sign) {
    const Voxel u{sign & 1 ? v[0] - d[0] : v[0] + d[0], sign & 2 ? v[1] - d[1] : v[1] + d[1],
                  sign & 4 ? v[2] - d[2] : v[2] + d[2]};
    if (mask.grid.contains(u) && mask[u] == 0) return true;
  }
  return false;
}

}  // namespace

Image<float> distances_to_background_mm(const Mask& mask) {
  Image<float> result(mask.grid);
  if (mask.voxels.empty()) return result;
  if (std::find(mask.voxels.begin(), mask.voxels.end(), 0) == mask.voxels.end()) {
    distances_to_outside_mm(result);
    return result;
  }
  transform_rows(mask, result);
  transform_axis(result, 1);
  transform_axis(result, 2);
  for (float& v : result.voxels) v = std::sqrt(v);
  return result;
}

std::vector<double> boundary_distances_mm(const Mask& mask,
                                          const std::vector<std::size_t>& offsets) {
  std::vector<double> result;
  result.reserve(offsets.size());
  Shells shells(mask.grid);
  Voxel last{};
  double last_mm =
      0.0;  // distance to background at the last place: at most one step less at the next
  for (const std::size_t offset : offsets) {
    const Voxel v = mask.grid.voxel(offset);
    const double moved = (mask.grid.world_mm(v) - mask.grid.world_mm(last)).norm();
    const double margin = 1e-9 * (last_mm + moved);
    std::size_t i = shells.first_at(std::max(0.0, last_mm - moved - margin));
    const Shells::Entry* entry = shells.at(i);
    while (entry && !reaches_background(mask, v, entry->d)) entry = shells.at(++i);
    if (!entry) {  // no background at all
      double least = std::numeric_limits<double>::infinity();
      for (std::size_t a = 0; a < 3; ++a)
        least = std::min(least, mask.grid.spacing_mm[static_cast<Eigen::Index>(a)] *
                                    (0.5 + std::min(v[a], mask.grid.size[a] - 1 - v[a])));
      result.push_back(least);
      last_mm = 0.0;
      continue;
    }
    result.push_back(entry->to_boundary_mm);
    last = v;
    last_mm = entry->distance_mm;
  }
  return result;
}

}  // namespace angiospline
