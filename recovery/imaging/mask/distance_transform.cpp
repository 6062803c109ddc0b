#include "recovery/imaging/mask/distance_transform.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "recovery/imaging/mask/foreground.h"

namespace angiospline {
namespace {

constexpr float kFar = std::numeric_limits<float>::infinity();

// The lower envelope of parabolas f(j) + (step (i - j))^2 over a line of samples.
class Envelope {
 public:
  // value[i * stride] becomes the envelope at i, for i in [0, n). Values may be infinite.
  void transform(float* value, std::size_t stride, int n, double step) {
    apexes_.clear();
    const double step2 = step * step;

    // The lower envelope of parabolas (Felzenszwalb & Huttenlocher 2012): each apex with where its
    // parabola begins to be the lowest.
    for (int i = 0; i < n; ++i) {
      const double f = static_cast<double>(value[static_cast<std::size_t>(i) * stride]);
      if (f == static_cast<double>(kFar)) continue;
      double from = -std::numeric_limits<double>::infinity();
      while (!apexes_.empty()) {
        const Apex& last = apexes_.back();
        from = 0.5 * ((f - last.value) / (step2 * (i - last.at)) + i + last.at);
        if (from > last.from) break;
        apexes_.pop_back();
        from = -std::numeric_limits<double>::infinity();
      }
      apexes_.push_back({i, f, from});
    }

    if (apexes_.empty()) return;
    std::size_t k = 0;
    for (int i = 0; i < n; ++i) {
      while (k + 1 < apexes_.size() && apexes_[k + 1].from < i) ++k;
      const double d = step * (i - apexes_[k].at);
      value[static_cast<std::size_t>(i) * stride] = static_cast<float>(d * d + apexes_[k].value);
    }
  }

 private:
  struct Apex {
    int at;
    double value;
    double from;  // where it begins to be the lowest
  };
  std::vector<Apex> apexes_;
};

// In an image without background: the distance from a voxel's centre to the outside, `first_step`
// voxels beyond the border voxels' centres.
double distance_to_outside_mm(const ImageGrid& grid, const Voxel& v, double first_step) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t a = 0; a < 3; ++a)
    least = std::min(least, grid.spacing_mm[static_cast<Eigen::Index>(a)] *
                                (first_step + std::min(v[a], grid.size[a] - 1 - v[a])));
  return least;
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

ForegroundDistances::ForegroundDistances(const Mask& mask) : grid_(mask.grid) {
  find_runs(mask);
  if (values_.size() == mask.voxels.size()) {
    for (std::size_t i = 0; i < values_.size(); ++i)
      values_[i] = static_cast<float>(distance_to_outside_mm(grid_, grid_.voxel(i), 1.0));
    return;
  }
  transform_across(1);
  transform_across(2);
  for (float& v : values_) v = std::sqrt(v);
}

// Runs of foreground along x, and in each the squared distance to the nearer end that is
// background.
void ForegroundDistances::find_runs(const Mask& mask) {
  const Voxel n = grid_.size;
  const double step = grid_.spacing_mm[0];
  row_begin_.assign(static_cast<std::size_t>(n[1]) * static_cast<std::size_t>(n[2]) + 1, 0);

  for (int z = 0; z < n[2]; ++z)
    for (int y = 0; y < n[1]; ++y) {
      const std::uint8_t* line = mask.voxels.data() + grid_.offset({0, y, z});
      for (int x = 0; x < n[0];) {
        x = static_cast<int>(
            next_foreground(line, static_cast<std::size_t>(x), static_cast<std::size_t>(n[0])));
        const int begin = x;
        while (x < n[0] && line[x] != 0) ++x;

        if (x == begin) continue;
        runs_.push_back({begin, x, values_.size()});
        for (int i = begin; i < x; ++i) {
          const double before = begin > 0 ? step * (i - begin + 1) : static_cast<double>(kFar);
          const double after = x < n[0] ? step * (x - i) : static_cast<double>(kFar);
          const double d = std::min(before, after);
          values_.push_back(static_cast<float>(d * d));
        }
      }
      row_begin_[row(y, z) + 1] = runs_.size();
    }
}

// Slices that hold the axis and x are spread into a plane with room for one background sample on
// either side, transformed stretch by stretch, and gathered again.
void ForegroundDistances::transform_across(int axis) {
  const Voxel n = grid_.size;
  const auto along = static_cast<std::size_t>(axis);
  const int slices = axis == 1 ? n[2] : n[1];
  const auto width = static_cast<std::size_t>(n[0]);
  const double step = grid_.spacing_mm[axis];

  tbb::parallel_for(tbb::blocked_range<int>(0, slices), [&](const tbb::blocked_range<int>& range) {
    std::vector<float> plane(width * static_cast<std::size_t>(n[along]), 0.0F);
    Envelope envelope;
    for (int slice = range.begin(); slice < range.end(); ++slice) {
      const auto for_runs = [&](const auto& use) {
        for (int i = 0; i < n[along]; ++i) {
          const std::size_t r = axis == 1 ? row(i, slice) : row(slice, i);
          for (std::size_t k = row_begin_[r]; k < row_begin_[r + 1]; ++k)
            use(i, runs_[k], plane.data() + static_cast<std::size_t>(i) * width);
        }
      };

      // Runs into the plane, columns transformed there, and back.
      for_runs([&](int, const Run& run, float* line) {
        std::copy_n(values_.data() + run.first, run.end - run.begin, line + run.begin);
      });
      for_runs([&](int i, const Run& run, float* line) {
        for (int x = run.begin; x < run.end; ++x) {
          float* top = line + x;
          if (i > 0 && *(top - width) != 0.0F) continue;  // not the first of its stretch
          int end = i + 1;
          while (end < n[along] && top[static_cast<std::size_t>(end - i) * width] != 0.0F) ++end;
          const int before = i > 0 ? 1 : 0;  // a background sample, 0, is part of the line
          const int after = end < n[along] ? 1 : 0;
          envelope.transform(top - (before == 1 ? width : 0), width, end - i + before + after,
                             step);
        }
      });
      for_runs([&](int, const Run& run, float* line) {
        std::copy_n(line + run.begin, run.end - run.begin, values_.data() + run.first);
        std::fill(line + run.begin, line + run.end, 0.0F);
      });
    }
  });
}

double ForegroundDistances::at_mm(std::size_t offset) const {
  const Voxel v = grid_.voxel(offset);
  const auto first = runs_.begin() + static_cast<std::ptrdiff_t>(row_begin_[row(v[1], v[2])]);
  const auto last = runs_.begin() + static_cast<std::ptrdiff_t>(row_begin_[row(v[1], v[2]) + 1]);
  const auto run =
      std::upper_bound(first, last, v[0], [](int x, const Run& r) { return x < r.end; });
  EXPECTS(run != last && run->begin <= v[0]);
  return static_cast<double>(values_[run->first + static_cast<std::size_t>(v[0] - run->begin)]);
}

double ForegroundDistances::largest_mm() const {
  const auto most = std::max_element(values_.begin(), values_.end());
  return most == values_.end() ? 0.0 : static_cast<double>(*most);
}

Image<float> ForegroundDistances::image() const {
  Image<float> image(grid_);
  for (int z = 0; z < grid_.size[2]; ++z)
    for (int y = 0; y < grid_.size[1]; ++y)
      for (std::size_t k = row_begin_[row(y, z)]; k < row_begin_[row(y, z) + 1]; ++k)
        std::copy_n(values_.data() + runs_[k].first, runs_[k].end - runs_[k].begin,
                    &image[{runs_[k].begin, y, z}]);
  return image;
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
      result.push_back(distance_to_outside_mm(mask.grid, v, 0.5));
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
