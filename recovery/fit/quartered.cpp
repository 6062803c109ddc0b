#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include "base/index.h"
#include "recovery/fit/closed_surface.h"
#include "recovery/fit/patches.h"
#include "recovery/fit/rings.h"

namespace angiospline {
namespace {

constexpr int kDegree = kPatchSize - 1;
constexpr int kHalves = 2 * kDegree;  // the last of the control points of a side in two halves

// Rows: control points of the two halves of a Bezier curve, the middle one once.
Eigen::Matrix<double, kHalves + 1, kPatchSize> halving_matrix() {
  Eigen::Matrix<double, kHalves + 1, kPatchSize> H;
  const Eigen::Matrix<double, kPatchSize, kPatchSize> all =
      Eigen::Matrix<double, kPatchSize, kPatchSize>::Identity();
  Eigen::Matrix<double, kPatchSize, kPatchSize> level = all;  // de Casteljau at 1/2
  for (int k = 0; k <= kDegree; ++k) {
    H.row(k) = level.row(0);
    H.row(kHalves - k) = level.row(kDegree - k);
    for (int i = 0; i < kDegree - k; ++i) {
      level.row(i) = ((level.row(i) + level.row(i + 1)) / 2).eval();
    }
  }
  return H;
}

// Pool columns of the points on the patches' sides: one for each place of a shared curve.
class SideColumns {
 public:
  explicit SideColumns(std::vector<Vec3>& pool) : pool_(pool) {}

  // `curve` has the six old columns of the side, `k` is the place along it.
  int at_place(std::array<int, kPatchSize> curve, int k, const Vec3& point) {
    if (k == 0) return curve.front();
    if (k == kHalves) return curve.back();
    std::array<int, kPatchSize> other = curve;
    std::reverse(other.begin(), other.end());
    if (other < curve) {
      curve = other;
      k = kHalves - k;
    }
    const auto [found, added] = known_.try_emplace({curve, k}, static_cast<int>(pool_.size()));
    if (added) pool_.push_back(point);
    return found->second;
  }

 private:
  std::vector<Vec3>& pool_;
  std::map<std::pair<std::array<int, kPatchSize>, int>, int> known_;
};

// Columns of the finer net of a patch, row by row along u.
std::vector<int> halved_columns(const SurfaceNetwork& network, const Patch& patch,
                                std::vector<Vec3>& pool, SideColumns& sides) {
  static const auto H = halving_matrix();
  Eigen::Matrix<double, kPatchSize, 3 * kPatchSize> net;  // row i along u, triples along v
  for (int i = 0; i < kPatchSize; ++i) {
    for (int j = 0; j < kPatchSize; ++j) {
      net.block<1, 3>(i, 3 * j) =
          network.control_points_mm.col(patch.control[index(i * kPatchSize + j)]).transpose();
    }
  }

  const auto old = [&](int i, int j) { return patch.control[index(i * kPatchSize + j)]; };

  // The tensor product of both halvings. Points on sides are shared with the neighbour.
  std::vector<int> columns;
  for (int i = 0; i <= kHalves; ++i) {
    const Eigen::RowVectorXd along = H.row(i) * net;
    for (int j = 0; j <= kHalves; ++j) {
      Vec3 point = Vec3::Zero();
      for (int b = 0; b < kPatchSize; ++b) point += H(j, b) * along.segment<3>(3 * b).transpose();

      std::array<int, kPatchSize> curve;
      if (i == 0 || i == kHalves) {
        for (int b = 0; b < kPatchSize; ++b) curve[index(b)] = old(i == 0 ? 0 : kDegree, b);
        columns.push_back(sides.at_place(curve, j, point));
      } else if (j == 0 || j == kHalves) {
        for (int b = 0; b < kPatchSize; ++b) curve[index(b)] = old(b, j == 0 ? 0 : kDegree);
        columns.push_back(sides.at_place(curve, i, point));
      } else {
        columns.push_back(static_cast<int>(pool.size()));
        pool.push_back(point);
      }
    }
  }
  return columns;
}

// quarters[p][2 a + b]: the part of patch p in half a along u and half b along v.
using Quarters = std::map<int, std::array<int, 4>>;

// Cuts the patches in four; the pool's new columns, in the order of their use.
Quarters quarter_patches(const SurfaceNetwork& network, const std::vector<int>& patches,
                         SurfaceNetwork& finer) {
  std::vector<Vec3> pool;
  for (Eigen::Index c = 0; c < network.control_points_mm.cols(); ++c) {
    pool.push_back(network.control_points_mm.col(c));
  }
  SideColumns sides(pool);

  Quarters quarters;
  for (const int p : patches) {
    const Patch& old = network.patches[index(p)];
    const std::vector<int> columns = halved_columns(network, old, pool, sides);
    for (int q = 0; q < 4; ++q) {
      Patch part{old.u, old.v, {}, old.region};
      for (int i = 0; i <= kDegree; ++i) {
        for (int j = 0; j <= kDegree; ++j) {
          const int row = kDegree * (q / 2) + i, column = kDegree * (q % 2) + j;
          part.control.push_back(columns[index(row * (kHalves + 1) + column)]);
        }
      }

      // The first quarter keeps the patch's number.
      quarters[p][index(q)] = q == 0 ? p : static_cast<int>(finer.patches.size());
      if (q == 0) {
        finer.patches[index(p)] = std::move(part);
      } else {
        finer.patches.push_back(std::move(part));
      }
    }
  }
  finer.control_points_mm =
      Eigen::Map<const Points3>(pool.data()->data(), 3, static_cast<Eigen::Index>(pool.size()));
  return quarters;
}

// A half of a side that was cut, as a whole side of a quarter.
Side half_of(const Side& side, const Quarters& quarters, int half) {
  const std::array<int, 4>& q = quarters.at(side.patch);
  const bool along_v = side.side == PatchSide::kU0 || side.side == PatchSide::kU1;
  const int far = side.side == PatchSide::kU1 || side.side == PatchSide::kV1 ? 1 : 0;
  return Side{q[index(along_v ? 2 * far + half : 2 * half + far)], side.side, 0.0, 1.0};
}

// The joins of the finer network: halves of the old ones, then those within each old patch.
std::vector<Join> join_quarters(const std::vector<Join>& old, const Quarters& quarters) {
  std::vector<Join> joins;
  for (const Join& join : old) {
    if (!quarters.contains(join.a.patch)) {
      joins.push_back(join);
      continue;
    }
    for (int half = 0; half < 2; ++half) {
      const int other = join.reversed ? 1 - half : half;
      joins.push_back(
          {half_of(join.a, quarters, half), half_of(join.b, quarters, other), join.reversed});
    }
  }

  for (const auto& [p, q] : quarters) {
    for (int k = 0; k < 2; ++k) {
      joins.push_back({{q[index(k)], PatchSide::kU1}, {q[index(2 + k)], PatchSide::kU0}, false});
      joins.push_back(
          {{q[index(2 * k)], PatchSide::kV1}, {q[index(2 * k + 1)], PatchSide::kV0}, false});
    }
  }
  return joins;
}

}  // namespace

SurfaceNetwork with_quartered(const SurfaceNetwork& network, const std::vector<int>& patches) {
  SurfaceNetwork finer = network;
  const Quarters quarters = quarter_patches(network, patches, finer);
  finer.joins = join_quarters(network.joins, quarters);
  return compacted(std::move(finer));
}

}  // namespace angiospline
