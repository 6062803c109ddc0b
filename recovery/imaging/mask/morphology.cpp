#include "recovery/imaging/mask/morphology.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>

#include "base/disjoint_sets.h"
#include "base/index.h"
#include "recovery/imaging/mask/foreground.h"

namespace angiospline {
namespace {

bool touch(int dx, int dy, int dz, Neighbours c) {
  const int steps = std::abs(dx) + std::abs(dy) + std::abs(dz);
  return steps > 0 && steps <= (c == Neighbours::kFaces6 ? 1 : c == Neighbours::kEdges18 ? 2 : 3);
}

std::vector<Voxel> neighbour_steps(Neighbours c) {
  std::vector<Voxel> steps;
  for (int z = -1; z <= 1; ++z)
    for (int y = -1; y <= 1; ++y)
      for (int x = -1; x <= 1; ++x)
        if (touch(x, y, z, c)) steps.push_back({x, y, z});
  return steps;
}

// `mask` with every neighbour of a voxel of class `from` made that class too.
Mask spread_once(const Mask& mask, bool from, const std::vector<Voxel>& steps) {
  Mask out = mask;
  const ImageGrid& grid = mask.grid;
  const auto to = static_cast<std::uint8_t>(from);
  std::size_t i = 0;
  for (int z = 0; z < grid.size[2]; ++z)
    for (int y = 0; y < grid.size[1]; ++y)
      for (int x = 0; x < grid.size[0]; ++x, ++i) {
        if ((mask.voxels[i] != 0) != from) continue;
        out.voxels[i] = to;
        for (const Voxel& s : steps) {
          const Voxel n{x + s[0], y + s[1], z + s[2]};
          if (grid.contains(n)) out[n] = to;
        }
      }
  return out;
}

Mask spread(const Mask& mask, bool from, int steps, Neighbours neighbours) {
  EXPECTS(steps >= 0);
  const std::vector<Voxel> around = neighbour_steps(neighbours);
  Mask out = mask;
  for (auto& v : out.voxels) v = v != 0;
  for (int k = 0; k < steps; ++k) out = spread_once(out, from, around);
  return out;
}

// First place in [x, count) whose class is not `foreground`, else count. Stretches of zeros, which
// most of an image is, go eight at a time.
int end_of_stretch(const std::uint8_t* row, int x, int count, bool foreground) {
  if (foreground) {
    while (x < count && row[x] != 0) ++x;
    return x;
  }
  for (std::uint64_t word = 0; x + 8 <= count; x += 8) {
    std::memcpy(&word, row + x, 8);
    if (word != 0) break;
  }
  while (x < count && row[x] == 0) ++x;
  return x;
}

// A stretch of equal voxels in one row: [begin, end).
struct Run {
  int begin, end;
  int component;
};

// Components of one class of a mask, held as runs: memory by the number of runs, not of voxels.
class RunComponents {
 public:
  RunComponents(const Mask& mask, bool foreground, Neighbours neighbours);

  const std::vector<Component>& list() const { return list_; }

  // f(offset of the run's first voxel, length, component)
  template <typename F>
  void for_each_run(F&& f) const {
    for (std::size_t row = 0; row + 1 < row_begin_.size(); ++row)
      for (std::size_t r = row_begin_[row]; r < row_begin_[row + 1]; ++r)
        f(row * width_ + static_cast<std::size_t>(runs_[r].begin),
          static_cast<std::size_t>(runs_[r].end - runs_[r].begin),
          static_cast<std::size_t>(runs_[r].component));
  }

 private:
  void add_row(const std::uint8_t* values, int width, const RowExtent& extent, bool foreground);
  void join_rows(std::size_t a, std::size_t b, int reach);
  void number(const ImageGrid& grid);

  std::size_t width_;
  std::vector<Run> runs_;
  std::vector<std::size_t> row_begin_;
  DisjointSets joined_;  // runs
  std::vector<Component> list_;
};

void RunComponents::add_row(const std::uint8_t* values, int width, const RowExtent& extent,
                            bool foreground) {
  const auto add = [&](int begin, int end) {
    if (begin < end) runs_.push_back({begin, end, -1});
  };
  if (!foreground) add(0, extent.empty() ? width : extent.begin);
  for (int x = extent.begin; x < extent.end;) {
    const int gap = end_of_stretch(values, x, extent.end, true);
    const int next = end_of_stretch(values, gap, extent.end, false);
    if (foreground)
      add(x, gap);
    else if (next < extent.end)
      add(gap, next);
    x = next;
  }
  if (!foreground && !extent.empty()) add(extent.end, width);
}

// Joins runs of two rows that overlap when one is widened by `reach`.
void RunComponents::join_rows(std::size_t a, std::size_t b, int reach) {
  std::size_t i = row_begin_[a], j = row_begin_[b];
  while (i < row_begin_[a + 1] && j < row_begin_[b + 1]) {
    const Run &p = runs_[i], &q = runs_[j];
    if (p.begin < q.end + reach && q.begin < p.end + reach)
      joined_.join(static_cast<int>(i), static_cast<int>(j));
    if (p.end < q.end)
      ++i;
    else
      ++j;
  }
}

RunComponents::RunComponents(const Mask& mask, bool foreground, Neighbours neighbours)
    : width_(static_cast<std::size_t>(mask.grid.size[0])) {
  const Voxel n = mask.grid.size;
  const auto rows = static_cast<std::size_t>(n[1]) * static_cast<std::size_t>(n[2]);
  row_begin_.reserve(rows + 1);
  row_begin_.push_back(0);
  const std::vector<RowExtent> extents = row_extents(mask);
  for (std::size_t row = 0; row < rows; ++row) {
    add_row(mask.voxels.data() + row * width_, n[0], extents[row], foreground);
    row_begin_.push_back(runs_.size());
  }

  joined_ = DisjointSets(runs_.size());
  // Rows already seen that touch row (y, z); `reach` lets a run touch diagonally along x.
  for (int z = 0; z < n[2]; ++z)
    for (int y = 0; y < n[1]; ++y)
      for (int dz = -1; dz <= 0; ++dz)
        for (int dy = -1; dy <= (dz == 0 ? -1 : 1); ++dy) {
          if (!touch(0, dy, dz, neighbours) || y + dy < 0 || y + dy >= n[1] || z + dz < 0) continue;
          const auto row = [&](int yy, int zz) {
            return static_cast<std::size_t>(zz) * static_cast<std::size_t>(n[1]) +
                   static_cast<std::size_t>(yy);
          };
          join_rows(row(y + dy, z + dz), row(y, z), touch(1, dy, dz, neighbours) ? 1 : 0);
        }
  number(mask.grid);
}

// Numbers components in order of the lowest offset (runs are in that order, and the root of a class
// is its lowest run), and gathers what is known of each.
void RunComponents::number(const ImageGrid& grid) {
  std::vector<int> number_of(runs_.size(), -1);
  const auto height = static_cast<std::size_t>(grid.size[1]);
  for (std::size_t row = 0; row + 1 < row_begin_.size(); ++row) {
    const int y = static_cast<int>(row % height), z = static_cast<int>(row / height);
    const bool edge_row = y == 0 || z == 0 || y == grid.size[1] - 1 || z == grid.size[2] - 1;
    for (std::size_t r = row_begin_[row]; r < row_begin_[row + 1]; ++r) {
      int& k = number_of[index(joined_.root(static_cast<int>(r)))];
      if (k < 0) {
        k = static_cast<int>(list_.size());
        list_.push_back({0, {runs_[r].begin, y, z}, false});
      }
      Component& c = list_[static_cast<std::size_t>(k)];
      c.voxels += static_cast<std::size_t>(runs_[r].end - runs_[r].begin);
      c.touches_border |= edge_row || runs_[r].begin == 0 || runs_[r].end == grid.size[0];
      runs_[r].component = k;
    }
  }
  joined_ = DisjointSets();
}

template <typename Keep>
Mask kept(const Mask& mask, const RunComponents& components, Keep&& keep) {
  Mask out(mask.grid);
  components.for_each_run([&](std::size_t first, std::size_t length, std::size_t k) {
    if (keep(k)) std::fill_n(out.voxels.begin() + static_cast<std::ptrdiff_t>(first), length, 1);
  });
  return out;
}

// The background region of `start` within its slice across `axis`, 4-connected, into `region`;
// empty if it has more than `largest` voxels or reaches the edge of the slice. Cost bounded by
// `largest`.
void find_enclosed_region(const Mask& mask, const Voxel& start, std::size_t axis,
                          std::size_t largest, std::vector<Voxel>& region) {
  region.assign(1, start);
  for (std::size_t k = 0; k < region.size(); ++k)
    for (std::size_t i = 0; i < 3; ++i) {
      if (i == axis) continue;
      for (const int step : {-1, 1}) {
        Voxel n = region[k];
        n[i] += step;
        if (!mask.grid.contains(n)) return region.clear();
        if (mask[n] != 0 || std::find(region.begin(), region.end(), n) != region.end()) continue;
        if (region.size() == largest) return region.clear();
        region.push_back(n);
      }
    }
}

// Background voxels with a foreground voxel across a face, each once, in order.
std::vector<std::size_t> outer_rim(const Mask& mask) {
  std::vector<std::size_t> rim;
  const Voxel n = mask.grid.size;
  for (int z = 0; z < n[2]; ++z)
    for (int y = 0; y < n[1]; ++y) {
      const std::uint8_t* row = mask.voxels.data() + mask.grid.offset({0, y, z});
      for (int x = end_of_stretch(row, 0, n[0], false); x < n[0];
           x = end_of_stretch(row, x + 1, n[0], false))
        for (std::size_t i = 0; i < 3; ++i)
          for (const int step : {-1, 1}) {
            Voxel v{x, y, z};
            v[i] += step;
            if (mask.grid.contains(v) && mask[v] == 0) rim.push_back(mask.grid.offset(v));
          }
    }
  std::sort(rim.begin(), rim.end());
  rim.erase(std::unique(rim.begin(), rim.end()), rim.end());
  return rim;
}

}  // namespace

Mask dilate(const Mask& mask, int steps, Neighbours neighbours) {
  return spread(mask, true, steps, neighbours);
}

Mask erode(const Mask& mask, int steps, Neighbours neighbours) {
  return spread(mask, false, steps, neighbours);
}

Mask close(const Mask& mask, int steps, Neighbours neighbours) {
  // Dilation must have room beyond the image, or the erosion would take too little away there.
  Mask padded;
  padded.grid.size = mask.grid.size;
  for (auto& n : padded.grid.size) n += 2 * steps;
  padded.voxels.assign(padded.grid.voxel_count(), 0);
  Mask out = mask;
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) {
    const Voxel v = mask.grid.voxel(i);
    padded[{v[0] + steps, v[1] + steps, v[2] + steps}] = mask.voxels[i] != 0;
  }
  padded = erode(dilate(padded, steps, neighbours), steps, neighbours);
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) {
    const Voxel v = mask.grid.voxel(i);
    out.voxels[i] = padded[{v[0] + steps, v[1] + steps, v[2] + steps}];
  }
  return out;
}

Filled fill_cavities(Mask mask, std::size_t largest) {
  Filled out;
  const RunComponents background(mask, false, Neighbours::kFaces6);
  const auto is_cavity = [&](std::size_t k) {
    const Component& c = background.list()[k];
    return !c.touches_border && c.voxels <= largest;
  };
  background.for_each_run([&](std::size_t first, std::size_t length, std::size_t k) {
    if (is_cavity(k))
      std::fill_n(mask.voxels.begin() + static_cast<std::ptrdiff_t>(first), length, 1);
  });
  for (std::size_t k = 0; k < background.list().size(); ++k)
    if (is_cavity(k)) {
      ++out.regions;
      out.voxels += background.list()[k].voxels;
    }
  out.mask = std::move(mask);
  return out;
}

Filled fill_holes(Mask mask, std::size_t largest) {
  Filled out;
  std::vector<std::size_t> holes;
  std::vector<Voxel> region;
  if (largest > 0)
    for (const std::size_t at : outer_rim(mask))
      for (std::size_t axis = 0; axis < 3; ++axis) {
        find_enclosed_region(mask, mask.grid.voxel(at), axis, largest, region);
        // Found again from each of its voxels on the rim; all are, so the lowest speaks for it.
        const bool lowest = std::all_of(region.begin(), region.end(),
                                        [&](const Voxel& v) { return mask.grid.offset(v) >= at; });
        if (region.empty() || !lowest) continue;
        ++out.regions;
        for (const Voxel& v : region) holes.push_back(mask.grid.offset(v));
      }
  for (const std::size_t at : holes) {
    out.voxels += mask.voxels[at] == 0;
    mask.voxels[at] = 1;
  }
  out.mask = std::move(mask);
  return out;
}

Components connected_components(const Mask& mask, Neighbours neighbours) {
  const RunComponents runs(mask, true, neighbours);
  Components out{Image<std::int32_t>(mask.grid), runs.list()};
  runs.for_each_run([&](std::size_t first, std::size_t length, std::size_t k) {
    std::fill_n(out.labels.voxels.begin() + static_cast<std::ptrdiff_t>(first), length,
                static_cast<std::int32_t>(k) + 1);
  });
  return out;
}

std::size_t component_count(const Mask& mask, Neighbours neighbours) {
  return RunComponents(mask, true, neighbours).list().size();
}

Mask largest_component(const Mask& mask, Neighbours neighbours) {
  const RunComponents runs(mask, true, neighbours);
  const auto best =
      std::max_element(runs.list().begin(), runs.list().end(),
                       [](const Component& a, const Component& b) { return a.voxels < b.voxels; });
  const auto chosen = static_cast<std::size_t>(best - runs.list().begin());
  return kept(mask, runs, [&](std::size_t k) { return k == chosen; });
}

Mask without_small_components(const Mask& mask, std::size_t smallest, Neighbours neighbours) {
  const RunComponents runs(mask, true, neighbours);
  return kept(mask, runs, [&](std::size_t k) { return runs.list()[k].voxels >= smallest; });
}

std::size_t voxel_count(const Mask& mask) {
  return mask.voxels.size() -
         static_cast<std::size_t>(std::count(mask.voxels.begin(), mask.voxels.end(), 0));
}

}  // namespace angiospline
