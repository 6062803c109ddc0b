#include "recovery/fit/fit_body.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Dense>

#include "base/index.h"
#include "kernel/evaluate/curvature.h"
#include "kernel/numerics/banded.h"
#include "kernel/spline/basis.h"
#include "recovery/fit/rules.h"

namespace angiospline {
namespace {

using namespace fit_rules;

class BodyFitter {
 public:
  BodyFitter(const SurfaceNetwork& network, const WallMoves& wall, const StripRing& ring)
      : old_(network), wall_(wall), ring_(ring) {}

  BodyFit fit(const Points3& pool, bool free_start, bool free_end) const {
    // Moves of the rows that are given.
    const int rows = ring_.rows(), n = ring_.points();
    const auto end_move = [&](int row) {
      Points3 moves(3, n);
      for (int c = 0; c < n; ++c) {
        moves.col(c) =
            pool.col(ring_.columns(row, c)) - old_.control_points_mm.col(ring_.columns(row, c));
      }
      return moves;
    };

    const Points3 start = end_move(0), end = end_move(rows - 1);
    if (start.isZero(0) && end.isZero(0) && !any_moves()) return {};

    const int first = free_start ? 1 : 2;
    const int last = free_end ? rows - 2 : rows - 3;
    Points3 moves = Points3::Zero(3, static_cast<Eigen::Index>(rows) * n);
    for (int i = 0; i < first; ++i) moves.middleCols(i * n, n) = start;
    for (int i = last + 1; i < rows; ++i) moves.middleCols(i * n, n) = end;

    BodyFit fit;
    const Points3 given = moves;
    const auto attempt = [&](double share, double fairness) {
      moves = given;
      if (last >= first) solve_rows(first, last, share, fairness, moves);
      fit.points = old_net() + moves;
      fit.share = share;
      return !folded(fit.points);
    };

    // As it is asked for, then stiffer, then a part of the way.
    for (const double fairness : kBody.fairness) {
      if (attempt(1.0, fairness)) return fit;
    }
    for (double share = 0.5; share >= kBody.least_share; share /= 2) {
      if (attempt(share, kBody.fairness.back())) return fit;
    }

    // Only the ends move; their moves die out over the rows between.
    for (int i = first; i <= last; ++i) {
      const double w = static_cast<double>(i) / (rows - 1);
      const double fade_start = std::max(0.0, 1 - 3 * w), fade_end = std::max(0.0, 3 * w - 2);
      moves.middleCols(i * n, n) = fade_start * start + fade_end * end;
    }
    fit.points = old_net() + moves;
    fit.share = 0.0;
    return fit;
  }

 private:
  bool any_moves() const {
    return std::any_of(ring_.patches.begin(), ring_.patches.end(), [&](int p) {
      const std::vector<int>& nodes = wall_.nodes_of[index(p)];
      return std::any_of(nodes.begin(), nodes.end(),
                         [&](int k) { return wall_.displacement_mm(k) != 0; });
    });
  }

  Points3 old_net() const {
    Points3 net(3, static_cast<Eigen::Index>(ring_.rows()) * ring_.points());
    for (int i = 0; i < ring_.rows(); ++i) {
      for (int c = 0; c < ring_.points(); ++c) {
        net.col(i * ring_.points() + c) = old_.control_points_mm.col(ring_.columns(i, c));
      }
    }
    return net;
  }

  // The normal equations of the rows that are free: band matrix and right-hand sides.
  struct Equations {
    int first, last;  // the free rows
    SymmetricBand A;
    Eigen::MatrixXd b;
  };

  // Least squares over rows first .. last, all other rows of `moves` given. Banded: rows of the net
  // are six apart at most.
  void solve_rows(int first, int last, double share, double fairness, Points3& moves) const {
    const Eigen::MatrixXd basis = ring_.basis();
    const Eigen::Index d = basis.cols();
    const Eigen::Index size = d * (last - first + 1);
    Equations equations{first, last, SymmetricBand::Zero(std::min(size, 6 * d), size),
                        Eigen::MatrixXd::Zero(size, 3)};
    for (std::size_t k = 0; k < ring_.patches.size(); ++k) {
      for (const int node : wall_.nodes_of[index(ring_.patches[k])]) {
        add_node(node, k, basis, share, moves, equations);
      }
    }

    SymmetricBand& A = equations.A;
    Eigen::MatrixXd& b = equations.b;
    add_fairness(first, last, basis, fairness, moves, A, b);
    A.row(0).array() += kBody.ridge * A.row(0).mean() + 1e-300;
    if (!factorise_band(A)) return;
    solve_band(A, b);
    for (int i = first; i <= last; ++i) {
      moves.middleCols(i * ring_.points(), ring_.points()) =
          (basis * b.middleRows(d * (i - first), d)).transpose();
    }
  }

  // One node of patch k of the ring: its move is what the net should do there, weighted by the
  // node's area.
  void add_node(int node, std::size_t k, const Eigen::MatrixXd& basis, double share,
                const Points3& moves, Equations& equations) const {
    const Eigen::Index d = basis.cols();
    const Vec2& uv = wall_.mesh.origins[index(node)].uv;
    const double place = static_cast<double>(k) + uv.y();
    const BasisValues bu = basis_at(ring_.u, uv.x(), 0);
    const auto [c0, bv] = ring_functions(place, static_cast<int>(ring_.patches.size()));
    const Eigen::VectorXd around = ring_row(ring_, basis, place);

    // What given rows do to the node goes to its right-hand side.
    Vec3 value = share * wall_.move_of(node);
    Eigen::VectorXd row = Eigen::VectorXd::Zero(6 * d);
    Eigen::Index from = -1;
    int parts = 0;
    for (int i = 0; i < 6; ++i) {
      const int r = bu.first + i;
      const double w = bu.values(0, i);
      if (r >= equations.first && r <= equations.last) {
        if (from < 0) from = d * (r - equations.first);
        row.segment(d * parts++, d) = w * around;
      } else {
        for (int j = 0; j < 6; ++j) {
          value -= w * bv(j) * moves.col(r * ring_.points() + (c0 + j) % ring_.points());
        }
      }
    }
    if (from < 0) return;

    const Eigen::Index count = d * parts;
    for (Eigen::Index x = 0; x < count; ++x) {
      const double wx = wall_.mass_mm2(node) * row(x);
      if (wx == 0) continue;
      for (Eigen::Index y = x; y < count; ++y) equations.A(y - x, from + x) += wx * row(y);
      equations.b.row(from + x) += wx * value.transpose();
    }
  }

  // Second differences of the moves from row to row: where spans have hardly more nodes than rows,
  // nothing else keeps rows from swinging.
  void add_fairness(int first, int last, const Eigen::MatrixXd& basis, double fairness,
                    const Points3& moves, SymmetricBand& A, Eigen::MatrixXd& b) const {
    const Eigen::Index d = basis.cols();
    const double weight = fairness * A.row(0).mean();
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> to_numbers(basis);

    const auto given = [&](int row) -> Eigen::MatrixXd {
      return to_numbers.solve(
          moves.middleCols(row * ring_.points(), ring_.points()).transpose().eval());
    };

    // Squares of x(i - 1) - 2 x(i) + x(i + 1); rows that are given go to the right-hand side.
    constexpr std::array<double, 3> kDifference{1, -2, 1};
    for (int middle = std::max(1, first - 1); middle <= std::min(ring_.rows() - 2, last + 1);
         ++middle) {
      Eigen::MatrixXd known = Eigen::MatrixXd::Zero(d, 3);
      for (int k = 0; k < 3; ++k) {
        const int row = middle - 1 + k;
        if (row < first || row > last) known += kDifference[index(k)] * given(row);
      }
      for (int k = 0; k < 3; ++k) {
        const int row = middle - 1 + k;
        if (row < first || row > last) continue;
        b.middleRows(d * (row - first), d) -= weight * kDifference[index(k)] * known;
        for (int l = k; l < 3; ++l) {
          if (middle - 1 + l > last) continue;
          A.row(d * (l - k)).segment(d * (row - first), d).array() +=
              weight * kDifference[index(k)] * kDifference[index(l)];
        }
      }
    }
  }

  // Whether the least Su x Sv against the old normal, over its mean, falls too far.
  bool folded(const Points3& net) const {
    double before = 1, after = 1, sum_before = 0, sum_after = 0;
    std::vector<std::pair<double, double>> areas;
    const int n = ring_.points();
    for (std::size_t k = 0; k < ring_.patches.size(); ++k) {
      Points3 control(3, static_cast<Eigen::Index>(ring_.rows()) * 6);
      for (int i = 0; i < ring_.rows(); ++i) {
        for (int j = 0; j < 6; ++j) {
          control.col(i * 6 + j) = net.col(i * n + (kPerPatch * static_cast<int>(k) + j) % n);
        }
      }

      const BSplineSurface<3> old = patch_surface(old_, ring_.patches[k]);
      const BSplineSurface<3> moved(ring_.u, old.v(), control);
      const std::vector<double> breaks = ring_.u.breakpoints();
      for (std::size_t s = 0; s + 1 < breaks.size(); ++s) {
        for (const double t : {0.0, 0.5}) {
          const double u = breaks[s] + t * (breaks[s + 1] - breaks[s]);
          for (const double v : {0.0, 0.25, 0.5, 0.75}) {
            const Vec3 normal = normal_vector(old, u, v);
            areas.emplace_back(normal.norm(), normal_vector(moved, u, v).dot(normal.normalized()));
            sum_before += areas.back().first;
            sum_after += areas.back().second;
          }
        }
      }
    }

    if (!(sum_after > 0)) return true;
    const double count = static_cast<double>(areas.size());
    for (const auto& [one, other] : areas) {
      before = std::min(before, one * count / sum_before);
      after = std::min(after, other * count / sum_after);
    }
    return after < kBody.least_jacobian * before;
  }

  const SurfaceNetwork& old_;
  const WallMoves& wall_;
  const StripRing& ring_;
};

}  // namespace

BodyFit fit_body(const SurfaceNetwork& network, const WallMoves& wall, const StripRing& ring,
                 const Points3& pool, bool free_start, bool free_end) {
  return BodyFitter(network, wall, ring).fit(pool, free_start, free_end);
}

}  // namespace angiospline
