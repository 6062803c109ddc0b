#include "recovery/imaging/mask/topology_numbers.h"

#include <algorithm>
#include <array>
#include <functional>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include "base/disjoint_sets.h"
#include "recovery/imaging/mask/foreground.h"

namespace angiospline {
namespace {

// A 2x2x2 window: bit x + 2 y + 4 z. Every cell (vertex, edge, face, cube) belongs to one window,
// the one about its lowest vertex, so the windows' parts sum to the Euler characteristic.
std::array<std::int8_t, 256> window_parts(Connectivity connectivity) {
  constexpr unsigned high[3] = {0b10101010, 0b11001100, 0b11110000};
  std::array<std::int8_t, 256> parts{};
  for (unsigned w = 0; w < 256; ++w) {
    // The closed cells of the complex (26), or the cells among voxel centres (6), at this vertex.
    const auto present = [&](unsigned voxels) {
      return connectivity == Connectivity::k26 ? (w & voxels) != 0 : (w & voxels) == voxels;
    };
    const int all = present(0xFF);
    const int halves = present(high[0]) + present(high[1]) + present(high[2]);
    const int quarters =
        present(high[0] & high[1]) + present(high[0] & high[2]) + present(high[1] & high[2]);
    const int one = present(0x80);
    parts[w] =
        static_cast<std::int8_t>(connectivity == Connectivity::k26 ? all - halves + quarters - one
                                                                   : one - quarters + halves - all);
  }
  return parts;
}

std::int64_t euler_characteristic(const Mask& mask, const std::vector<RowExtent>& extents,
                                  Connectivity connectivity) {
  const Voxel n = mask.grid.size;
  const std::array<std::int8_t, 256> parts = window_parts(connectivity);
  const std::vector<std::uint8_t> outside(static_cast<std::size_t>(n[0]), 0);

  const auto sum_windows = [&](int y, int z) {
    std::array<const std::uint8_t*, 4> r;
    int begin = n[0], end = 0;
    for (unsigned k = 0; k < 4; ++k) {
      const int row_y = y - 1 + static_cast<int>(k & 1), row_z = z - 1 + static_cast<int>(k >> 1);
      r[k] = outside.data();
      if (row_y < 0 || row_z < 0 || row_y >= n[1] || row_z >= n[2]) continue;
      const RowExtent& e =
          extents[static_cast<std::size_t>(row_y) +
                  static_cast<std::size_t>(n[1]) * static_cast<std::size_t>(row_z)];
      if (e.empty()) continue;
      r[k] = &mask.voxels[mask.grid.offset({0, row_y, row_z})];
      begin = std::min(begin, e.begin);
      end = std::max(end, e.end);
    }

    // A window goes on by one voxel: its high half becomes its low one.
    std::int64_t sum = 0;
    unsigned w = 0;
    for (int x = begin; x <= end && end > 0; ++x) {
      w = w >> 1 & 0x55U;
      if (x < n[0])
        for (unsigned k = 0; k < 4; ++k) w |= (r[k][x] != 0 ? 2U : 0U) << (2 * k);
      sum += parts[w];
    }
    return sum;
  };

  return tbb::parallel_reduce(
      tbb::blocked_range<int>(0, n[2] + 1), std::int64_t{0},
      [&](const tbb::blocked_range<int>& range, std::int64_t sum) {
        for (int z = range.begin(); z < range.end(); ++z)
          for (int y = 0; y <= n[1]; ++y) sum += sum_windows(y, z);
        return sum;
      },
      std::plus<>());
}

// Counts the pieces of foreground or background by joining runs along x with those of earlier rows.
class RunPieces {
 public:
  RunPieces(const Mask& mask, const std::vector<RowExtent>& extents, bool foreground,
            Connectivity connectivity)
      : mask_(mask),
        extents_(extents),
        foreground_(foreground),
        reach_(connectivity == Connectivity::k26 ? 1 : 0) {
    const Voxel n = mask.grid.size;
    pieces_.add();  // piece 0 is the outside
    row_begin_.assign(static_cast<std::size_t>(n[1]) * static_cast<std::size_t>(n[2]) + 1, 0);
    for (int z = 0; z < n[2]; ++z)
      for (int y = 0; y < n[1]; ++y) {
        add_row(y, z);
        join(y, z, y - 1, z);
        join(y, z, y, z - 1);
        if (reach_ == 0) continue;
        join(y, z, y - 1, z - 1);
        join(y, z, y + 1, z - 1);
      }
  }

  // Pieces apart from the outside.
  std::int64_t count() const { return pieces_.count() - 1; }

 private:
  struct Run {
    int begin, end;
    int piece;
  };

  std::size_t row_index(int y, int z) const {
    return static_cast<std::size_t>(y) +
           static_cast<std::size_t>(mask_.grid.size[1]) * static_cast<std::size_t>(z);
  }

  // Background before and behind a row's foreground reaches the border: it is part of the outside.
  void add_row(int y, int z) {
    const Voxel n = mask_.grid.size;
    const RowExtent& extent = extents_[row_index(y, z)];
    if (extent.empty()) {
      if (!foreground_) runs_.push_back({0, n[0], 0});
    } else {
      const bool rim = y == 0 || z == 0 || y == n[1] - 1 || z == n[2] - 1;
      const std::uint8_t* row = &mask_.voxels[mask_.grid.offset({0, y, z})];
      if (!foreground_ && extent.begin > 0) runs_.push_back({0, extent.begin, 0});
      for (int x = extent.begin; x < extent.end;) {
        const int begin = x;
        while (x < extent.end && row[x] != 0) ++x;
        const int gap = x;
        x = static_cast<int>(next_foreground(row, static_cast<std::size_t>(x),
                                             static_cast<std::size_t>(extent.end)));
        if (foreground_)
          add_piece(begin, gap, false);
        else if (x < extent.end)
          add_piece(gap, x, rim);
      }
      if (!foreground_ && extent.end < n[0]) runs_.push_back({extent.end, n[0], 0});
    }

    row_begin_[row_index(y, z) + 1] = runs_.size();
  }

  void add_piece(int begin, int end, bool is_outside) {
    runs_.push_back({begin, end, is_outside ? 0 : pieces_.add()});
  }

  void join(int y, int z, int other_y, int other_z) {
    if (other_y < 0 || other_z < 0 || other_y >= mask_.grid.size[1]) return;
    std::size_t a = row_begin_[row_index(y, z)];
    std::size_t b = row_begin_[row_index(other_y, other_z)];
    const std::size_t a_end = row_begin_[row_index(y, z) + 1];
    const std::size_t b_end = row_begin_[row_index(other_y, other_z) + 1];
    while (a < a_end && b < b_end) {
      if (runs_[a].begin < runs_[b].end + reach_ && runs_[b].begin < runs_[a].end + reach_)
        pieces_.join(runs_[a].piece, runs_[b].piece);
      if (runs_[a].end < runs_[b].end)
        ++a;
      else
        ++b;
    }
  }

  const Mask& mask_;
  const std::vector<RowExtent>& extents_;
  bool foreground_;
  int reach_;
  std::vector<Run> runs_;
  DisjointSets pieces_;
  std::vector<std::size_t> row_begin_;
};

}  // namespace

TopologyNumbers topology_numbers(const Mask& mask, Connectivity connectivity) {
  TopologyNumbers t;
  if (mask.voxels.empty()) return t;
  const Connectivity other =
      connectivity == Connectivity::k26 ? Connectivity::k6 : Connectivity::k26;
  const std::vector<RowExtent> extents = row_extents(mask);
  t.components = RunPieces(mask, extents, true, connectivity).count();
  t.cavities = RunPieces(mask, extents, false, other).count();
  t.euler = euler_characteristic(mask, extents, connectivity);
  t.cycles = t.components + t.cavities - t.euler;
  return t;
}

}  // namespace angiospline
