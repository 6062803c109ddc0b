#include "modeling/continuity/mend_bodies.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <Eigen/Geometry>
#include <Eigen/QR>

#include "base/index.h"
#include "modeling/continuity/rules.h"

namespace angiospline {
namespace {

using namespace continuity_rules;

int rows_of(const Patch& patch) { return patch.u.control_point_count(); }

// What a body's end row joins: the patches beyond and their sides.
struct JoinedEnd {
  std::vector<Side> own;
  std::vector<Side> others;
};

class Mender {
 public:
  Mender(SurfaceNetwork& network, const BodyRing& ring)
      : network_(network), ring_(ring), rows_(rows_of(network.patches[index(ring.strips[0])])) {
    for (const Dependency& dependency : network.dependencies) dependent_.insert(dependency.point);
  }

  std::vector<int> run() {
    const std::vector<JoinedEnd> ends{end_joins(PatchSide::kU0), end_joins(PatchSide::kU1)};
    std::set<int> beyond;
    for (const JoinedEnd& end : ends) {
      for (const Side& side : end.others) {
        center_corners(side.patch);
        beyond.insert(network_.patches[index(side.patch)].region);
      }
    }

    // What goes on beyond an end rules: first its rows are put right, then the seams follow.
    flatten_rims();
    apply_dependencies(network_);
    for (std::size_t e = 0; e < 2; ++e) {
      if (!ends[e].others.empty()) align(ends[e], e == 0);
    }
    mend_seams(ends);
    apply_dependencies(network_);
    beyond.erase(ring_.region);
    return {beyond.begin(), beyond.end()};
  }

 private:
  auto point(int column) { return network_.control_points_mm.col(column); }

  int column(int patch, int row, int j) const {
    return network_.patches[index(patch)].control[index(row * kStripColumns + j)];
  }

  JoinedEnd end_joins(PatchSide side) const {
    JoinedEnd end;
    const auto is_ours = [&](const Side& s) {
      return s.side == side &&
             std::find(ring_.strips.begin(), ring_.strips.end(), s.patch) != ring_.strips.end();
    };
    for (const Join& join : network_.joins) {
      if (is_ours(join.a) == is_ours(join.b)) continue;
      end.own.push_back(is_ours(join.a) ? join.a : join.b);
      end.others.push_back(is_ours(join.a) ? join.b : join.a);
    }
    return end;
  }

  // Both rows at an open end into the rim's plane, so that the wall ends across its axis.
  void flatten_rims() {
    for (const Rim& rim : network_.rims) {
      for (const Side& side : rim.sides) {
        if (network_.patches[index(side.patch)].region != ring_.region) continue;
        for (const auto& [end, next] : beside(side)) {
          point(end) -= rim.normal.dot(Vec3(point(end)) - rim.center_mm) * rim.normal;
        }
      }
    }
  }

  // Of an opening's sector: its corner and the one it shares with the next.
  void center_corners(int patch) {
    if (network_.regions[index(network_.patches[index(patch)].region)].kind !=
        RegionKind::kJunction) {
      return;
    }
    for (const Join& join : network_.joins) {
      if (join.a.side != PatchSide::kV1 || join.b.side != PatchSide::kV0) continue;
      if (join.a.patch != patch && join.b.patch != patch) continue;
      const Vec3 left = point(column(join.a.patch, 0, kStripColumns - 2));
      const Vec3 right = point(column(join.b.patch, 0, 1));
      point(column(join.b.patch, 0, 0)) = (left + right) / 2;
    }
  }

  // Columns of the side's own row and of the row beside it.
  std::vector<std::pair<int, int>> beside(const Side& side) const {
    const Patch& patch = network_.patches[index(side.patch)];
    const int own = side.side == PatchSide::kU0 ? 0 : rows_of(patch) - 1;
    const int next = side.side == PatchSide::kU0 ? 1 : rows_of(patch) - 2;
    std::vector<std::pair<int, int>> pairs;
    for (int j = 0; j < kStripColumns; ++j) {
      pairs.emplace_back(column(side.patch, own, j), column(side.patch, next, j));
    }
    return pairs;
  }

  // From an end's row to the one beside it, in the mean.
  Vec3 mean_step(const std::vector<Side>& sides) {
    Vec3 sum = Vec3::Zero();
    for (const Side& side : sides) {
      for (const auto& [rim, next] : beside(side)) sum += point(next) - point(rim);
    }
    return sum / static_cast<double>(sides.size());
  }

  // The rows beside an end go along one direction on both sides of it: cross derivatives are then
  // parallel at every point, and the triple product of (3.1) in the thesis vanishes.
  void align(const JoinedEnd& end, bool at_start) {
    const Vec3 into =
        (mean_step(end.own).normalized() - mean_step(end.others).normalized()).normalized();
    for (const Side& side : end.others) {
      for (const auto& [rim, next] : beside(side)) {
        point(next) = point(rim) + into.dot(Vec3(point(next) - point(rim))) * into;
      }
    }

    // The body's steps as an affine function of the place, so that all its seams keep their ratios.
    const int row = at_start ? 0 : rows_ - 1;
    const int next_row = at_start ? 1 : rows_ - 2;
    const Eigen::Index count = static_cast<Eigen::Index>(ring_.strips.size()) * (kStripColumns - 1);
    Eigen::MatrixXd A(count, 3);
    Eigen::VectorXd steps(count);
    Points3 rims(3, count);
    std::vector<int> moved;
    for (const int strip : ring_.strips) {
      for (int j = 0; j + 1 < kStripColumns; ++j) {
        const auto k = static_cast<Eigen::Index>(moved.size());
        moved.push_back(column(strip, next_row, j));
        rims.col(k) = point(column(strip, row, j));
        steps(k) = into.dot(Vec3(point(moved.back()) - rims.col(k)));
      }
    }

    // Least squares of step = c0 + c1 x + c2 y over the end's row.
    const Vec3 center = rims.rowwise().mean();
    const Vec3 x = into.unitOrthogonal();
    const Vec3 y = into.cross(x);
    const double size = (rims.colwise() - center).norm();
    for (Eigen::Index k = 0; k < count; ++k) {
      const Vec3 away = (rims.col(k) - center) / size;
      A.row(k) << 1, away.dot(x), away.dot(y);
    }
    const Eigen::VectorXd fitted = A * A.colPivHouseholderQr().solve(steps).eval();
    for (Eigen::Index k = 0; k < count; ++k) {
      point(moved[static_cast<std::size_t>(k)]) = rims.col(k) + fitted(k) * into;
    }
  }

  // Each seam point between its two neighbours, in one ratio along the whole body: two strips then
  // have one cross tangent up to a factor. The ratio is that of a joined end, which must not move.
  void mend_seams(const std::vector<JoinedEnd>& ends) {
    const int count = static_cast<int>(ring_.strips.size());
    const bool from_start = !ends[0].others.empty();
    const bool from_end = !from_start && !ends[1].others.empty();
    for (int k = 0; k < count; ++k) {
      const int before = ring_.strips[index((k + count - 1) % count)];
      const int after = ring_.strips[index(k)];
      const auto log_ratio = [&](int row) {
        const Vec3 seam = point(column(after, row, 0));
        return std::log((seam - Vec3(point(column(before, row, kStripColumns - 2)))).norm() /
                        (Vec3(point(column(after, row, 1))) - seam).norm());
      };

      double sum = 0;
      for (int row = 0; row < rows_; ++row) sum += log_ratio(row) / rows_;
      const double ratio = std::exp(from_start ? log_ratio(0)
                                    : from_end ? log_ratio(rows_ - 1)
                                               : sum);

      for (int row = 0; row < rows_; ++row) {
        const int seam = column(after, row, 0);
        const bool shared =
            (row == 0 && from_start) || (row == rows_ - 1 && !ends[1].others.empty());
        if (shared || dependent_.contains(seam)) continue;
        const Vec3 left = point(column(before, row, kStripColumns - 2));
        const Vec3 right = point(column(after, row, 1));
        point(seam) = (left + ratio * right) / (1 + ratio);
      }
    }
  }

  SurfaceNetwork& network_;
  const BodyRing& ring_;
  int rows_;
  std::set<int> dependent_;
};

}  // namespace

std::vector<BodyRing> body_rings(const SurfaceNetwork& network) {
  std::vector<int> next(network.patches.size(), -1);
  const auto is_strip = [&](int p) {
    const Patch& patch = network.patches[index(p)];
    return network.regions[index(patch.region)].kind == RegionKind::kBody &&
           patch.v.control_point_count() == kStripColumns && rows_of(patch) >= kLeastStripRows;
  };
  for (const Join& join : network.joins) {
    const bool forward = join.a.side == PatchSide::kV1 && join.b.side == PatchSide::kV0;
    const bool backward = join.a.side == PatchSide::kV0 && join.b.side == PatchSide::kV1;
    if (join.reversed || (!forward && !backward)) continue;
    const int from = forward ? join.a.patch : join.b.patch;
    const int to = forward ? join.b.patch : join.a.patch;
    if (is_strip(from) && is_strip(to)) next[index(from)] = to;
  }

  // From strip to strip until the first comes again; what does not close is no body's ring.
  std::vector<BodyRing> rings;
  std::vector<char> seen(network.patches.size(), 0);
  for (int p = 0; p < static_cast<int>(network.patches.size()); ++p) {
    if (next[index(p)] < 0 || seen[index(p)]) continue;
    BodyRing ring{{}, network.patches[index(p)].region};
    int q = p;
    for (; q >= 0 && !seen[index(q)]; q = next[index(q)]) {
      seen[index(q)] = 1;
      ring.strips.push_back(q);
    }
    const bool even = std::all_of(ring.strips.begin(), ring.strips.end(), [&](int strip) {
      return rows_of(network.patches[index(strip)]) == rows_of(network.patches[index(p)]);
    });
    if (q == p && even) rings.push_back(std::move(ring));
  }
  return rings;
}

std::vector<int> mend_body(SurfaceNetwork& network, const BodyRing& ring) {
  return Mender(network, ring).run();
}

}  // namespace angiospline
