#include "recovery/fit/rings.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <Eigen/Dense>
#include <tbb/parallel_for.h>

#include "base/contract.h"
#include "base/index.h"
#include "kernel/evaluate/curvature.h"
#include "kernel/fit/fit.h"
#include "kernel/refine/refinement.h"
#include "kernel/spline/basis.h"

namespace angiospline {
namespace {

bool fits_a_ring(const Patch& patch) {
  return patch.v == KnotVector::bezier(5) && patch.u.degree() == 5;
}

// next[p]: the patch beyond kV1 of p, if it is of the same region and shares the whole side.
std::vector<int> next_patches(const SurfaceNetwork& network) {
  std::vector<int> next(network.patches.size(), -1);
  for (const Join& join : network.joins) {
    Side a = join.a, b = join.b;
    if (a.side == PatchSide::kV0 && b.side == PatchSide::kV1) std::swap(a, b);
    if (a.side != PatchSide::kV1 || b.side != PatchSide::kV0 || join.reversed) continue;
    const Patch& p = network.patches[index(a.patch)];
    const Patch& q = network.patches[index(b.patch)];
    if (p.region == q.region && p.u == q.u && fits_a_ring(p) && fits_a_ring(q)) {
      next[index(a.patch)] = b.patch;
    }
  }
  return next;
}

// Of the first row: in a body all rows agree with it by construction.
double seam_ratio(const SurfaceNetwork& network, const StripRing& ring, int patch) {
  const int n = ring.points();
  const int seam = kPerPatch * patch;
  const auto point = [&](int c) -> Vec3 {
    return network.control_points_mm.col(ring.columns(0, (c + n) % n));
  };
  const Vec3 near = point(seam) - point(seam - 1);
  return near.dot(point(seam + 1) - point(seam)) / near.squaredNorm();
}

}  // namespace

Eigen::MatrixXd StripRing::basis() const {
  const int n = static_cast<int>(patches.size());
  Eigen::MatrixXd B = Eigen::MatrixXd::Zero(kPerPatch * n, 4 * n);
  for (int k = 0; k < n; ++k) {
    const int seam = kPerPatch * k;
    const int before = (seam + kPerPatch * n - 1) % (kPerPatch * n);
    const double ratio = seam_ratios[index(k)];
    B(seam, 4 * k) = B(seam + 1, 4 * k) = B(before, 4 * k) = 1;
    B(seam + 1, 4 * k + 1) = ratio / (1 + ratio);
    B(before, 4 * k + 1) = -1 / (1 + ratio);
    B(seam + 2, 4 * k + 2) = B(seam + 3, 4 * k + 3) = 1;
  }
  return B;
}

std::pair<int, Eigen::Matrix<double, 6, 1>> ring_functions(double place, int patches) {
  static const KnotVector knots = KnotVector::bezier(5);
  const int patch = std::min(static_cast<int>(place), patches - 1);
  return {kPerPatch * patch, basis_at(knots, place - patch, 0).values.row(0).transpose().head<6>()};
}

Eigen::VectorXd ring_row(const StripRing& ring, const Eigen::MatrixXd& basis, double place) {
  const auto [first, values] = ring_functions(place, static_cast<int>(ring.patches.size()));
  Eigen::VectorXd row = Eigen::VectorXd::Zero(basis.cols());
  for (int k = 0; k < 6; ++k) {
    row += values(k) * basis.row((first + k) % ring.points()).transpose();
  }
  return row;
}

std::vector<StripRing> strip_rings(const SurfaceNetwork& network) {
  const std::vector<int> next = next_patches(network);
  std::vector<char> used(next.size(), 0);
  std::vector<StripRing> rings;
  for (std::size_t first = 0; first < next.size(); ++first) {
    if (used[first]) continue;

    // On from patch to patch; what does not come back is no ring.
    StripRing ring;
    int p = static_cast<int>(first);
    while (p >= 0 && !used[index(p)]) {
      used[index(p)] = 1;
      ring.patches.push_back(p);
      p = next[index(p)];
    }
    if (p != static_cast<int>(first)) continue;

    const Patch& patch = network.patches[first];
    ring.region = patch.region;
    ring.u = patch.u;
    const int n = static_cast<int>(ring.patches.size());
    ring.columns.resize(patch.u.control_point_count(), kPerPatch * n);
    for (int k = 0; k < n; ++k) {
      const std::vector<int>& control = network.patches[index(ring.patches[index(k)])].control;
      for (int i = 0; i < ring.rows(); ++i) {
        for (int j = 0; j < kPerPatch; ++j) {
          ring.columns(i, kPerPatch * k + j) = control[index(i * (kPerPatch + 1) + j)];
        }
      }
    }

    for (int k = 0; k < n; ++k) ring.seam_ratios.push_back(seam_ratio(network, ring, k));
    rings.push_back(std::move(ring));
  }
  return rings;
}

namespace {

// Centre and mean radius of the ring's control points in a row.
std::pair<Vec3, double> center_of_row(const SurfaceNetwork& network, const StripRing& ring, int i) {
  Vec3 center = Vec3::Zero();
  for (int c = 0; c < ring.points(); ++c) {
    center += network.control_points_mm.col(ring.columns(i, c)) / ring.points();
  }
  double radius = 0;
  for (int c = 0; c < ring.points(); ++c) {
    radius += (network.control_points_mm.col(ring.columns(i, c)) - center).norm() / ring.points();
  }
  return {center, radius};
}

// Interior knots that bisect spans until none is longer than `radii` of the ring.
std::vector<double> finer_knots(const SurfaceNetwork& network, const StripRing& ring,
                                double radii) {
  Points3 centers(3, ring.rows());
  Eigen::VectorXd sizes(ring.rows());
  for (int i = 0; i < ring.rows(); ++i) {
    const auto [center, radius] = center_of_row(network, ring, i);
    centers.col(i) = center;
    sizes(i) = radius;
  }
  const BSplineCurve<3> axis(ring.u, centers);
  const BSplineCurve<1> size(ring.u, sizes.transpose());

  std::vector<double> added;
  const std::vector<double> breaks = ring.u.breakpoints();
  for (std::size_t k = 0; k + 1 < breaks.size(); ++k) {
    const double from = breaks[k], to = breaks[k + 1];
    double length = 0, radius = 0;

    constexpr int kSamples = 16;
    Vec3 before = axis.at(from);
    for (int s = 1; s <= kSamples; ++s) {
      const double t = from + (to - from) * s / kSamples;
      const Vec3 p = axis.at(t);
      length += (p - before).norm();
      before = p;
      radius += size.at(t)(0) / kSamples;
    }

    // Bisected until no part is longer than it may be.
    int parts = 1;
    while (length > parts * radii * radius && parts < 4096) parts *= 2;
    for (int s = 1; s < parts; ++s) added.push_back(from + (to - from) * s / parts);
  }
  return added;
}

}  // namespace

void set_rows(SurfaceNetwork& network, const StripRing& ring, const KnotVector& u,
              const Eigen::MatrixXi& columns) {
  for (std::size_t k = 0; k < ring.patches.size(); ++k) {
    Patch& patch = network.patches[index(ring.patches[k])];
    patch.u = u;
    patch.control.clear();
    for (Eigen::Index i = 0; i < columns.rows(); ++i) {
      for (int j = 0; j <= kPerPatch; ++j) {
        patch.control.push_back(columns(i, (kPerPatch * static_cast<int>(k) + j) % ring.points()));
      }
    }
  }
}

SurfaceNetwork compacted(SurfaceNetwork network) {
  std::vector<int> number(index(network.control_points_mm.cols()), -1);
  int count = 0;
  const auto use = [&](int& column) {
    int& n = number[index(column)];
    if (n < 0) n = count++;
    column = n;
  };

  for (Patch& patch : network.patches) {
    for (int& c : patch.control) use(c);
  }
  for (Dependency& d : network.dependencies) {
    use(d.point);
    for (auto& [master, weight] : d.masters) use(master);
  }

  Points3 kept(3, count);
  for (std::size_t c = 0; c < number.size(); ++c) {
    if (number[c] >= 0) {
      kept.col(number[c]) = network.control_points_mm.col(static_cast<Eigen::Index>(c));
    }
  }
  network.control_points_mm = std::move(kept);
  return network;
}

SurfaceNetwork with_knots_added(const SurfaceNetwork& network, const std::vector<StripRing>& rings,
                                const std::vector<std::vector<double>>& added) {
  EXPECTS(added.size() == rings.size());
  SurfaceNetwork finer = network;
  std::vector<Vec3> pool;
  for (Eigen::Index c = 0; c < network.control_points_mm.cols(); ++c) {
    pool.push_back(network.control_points_mm.col(c));
  }

  for (std::size_t r = 0; r < rings.size(); ++r) {
    if (added[r].empty()) continue;
    const StripRing& ring = rings[r];
    EXPECTS(network.regions[index(ring.region)].kind == RegionKind::kBody);

    const KnotVector u = with_knots(ring.u, added[r]).value();
    const int rows = u.control_point_count();
    Eigen::MatrixXi columns(rows, ring.points());
    columns.row(0) = ring.columns.row(0);
    columns.row(rows - 1) = ring.columns.row(ring.rows() - 1);

    // Rows between the ends are the ring's own; those at the ends are shared.
    for (std::size_t k = 0; k < ring.patches.size(); ++k) {
      const BSplineSurface<3> old = patch_surface(network, ring.patches[k]);
      const BSplineSurface<3> surface = refine(old, u, old.v());
      for (int i = 1; i + 1 < rows; ++i) {
        for (int j = 0; j < kPerPatch; ++j) {
          columns(i, kPerPatch * static_cast<int>(k) + j) = static_cast<int>(pool.size());
          pool.push_back(surface.control_point(i, j));
        }
      }
    }

    set_rows(finer, ring, u, columns);
  }

  finer.control_points_mm =
      Eigen::Map<const Points3>(pool.data()->data(), 3, static_cast<Eigen::Index>(pool.size()));
  return compacted(std::move(finer));
}

SurfaceNetwork with_finer_bodies(const SurfaceNetwork& network, double radii) {
  const std::vector<StripRing> rings = strip_rings(network);
  std::vector<std::vector<double>> added;
  for (const StripRing& ring : rings) {
    const bool body = network.regions[index(ring.region)].kind == RegionKind::kBody;
    added.push_back(body ? finer_knots(network, ring, radii) : std::vector<double>());
  }
  return with_knots_added(network, rings, added);
}

}  // namespace angiospline
