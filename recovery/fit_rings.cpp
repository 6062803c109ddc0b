#include "recovery/fit_rings.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <tbb/parallel_for.h>

#include "base/contract.h"
#include "kernel/fit.h"
#include "kernel/reduce_engine.h"
#include "kernel/refinement.h"

namespace angiospline {
namespace {

constexpr int kHeld = 2;      // value and first derivative at the ends of a body
constexpr int kPerPatch = 5;  // control points of a quintic Bezier patch around the ring

std::size_t at(Eigen::Index i) { return static_cast<std::size_t>(i); }

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
    const Patch& p = network.patches[at(a.patch)];
    const Patch& q = network.patches[at(b.patch)];
    if (p.region == q.region && p.u == q.u && fits_a_ring(p) && fits_a_ring(q)) {
      next[at(a.patch)] = b.patch;
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
    const double ratio = seam_ratios[at(k)];
    B(seam, 4 * k) = B(seam + 1, 4 * k) = B(before, 4 * k) = 1;
    B(seam + 1, 4 * k + 1) = ratio / (1 + ratio);
    B(before, 4 * k + 1) = -1 / (1 + ratio);
    B(seam + 2, 4 * k + 2) = B(seam + 3, 4 * k + 3) = 1;
  }
  return B;
}

std::vector<StripRing> strip_rings(const SurfaceNetwork& network) {
  const std::vector<int> next = next_patches(network);
  std::vector<char> used(next.size(), 0);
  std::vector<StripRing> rings;
  for (std::size_t first = 0; first < next.size(); ++first) {
    if (used[first]) continue;
    StripRing ring;
    int p = static_cast<int>(first);
    while (p >= 0 && !used[at(p)]) {
      used[at(p)] = 1;
      ring.patches.push_back(p);
      p = next[at(p)];
    }
    if (p != static_cast<int>(first)) continue;
    const Patch& patch = network.patches[first];
    ring.region = patch.region;
    ring.u = patch.u;
    const int n = static_cast<int>(ring.patches.size());
    ring.columns.resize(patch.u.control_point_count(), kPerPatch * n);
    for (int k = 0; k < n; ++k) {
      const std::vector<int>& control = network.patches[at(ring.patches[at(k)])].control;
      for (int i = 0; i < ring.rows(); ++i) {
        for (int j = 0; j < kPerPatch; ++j) {
          ring.columns(i, kPerPatch * k + j) = control[at(i * (kPerPatch + 1) + j)];
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
    int parts = 1;
    while (length > parts * radii * radius && parts < 4096) parts *= 2;
    for (int s = 1; s < parts; ++s) added.push_back(from + (to - from) * s / parts);
  }
  return added;
}

// Drops the columns that nothing uses any more.
void compact(SurfaceNetwork& network) {
  std::vector<int> number(at(network.control_points_mm.cols()), -1);
  int count = 0;
  const auto use = [&](int& column) {
    int& n = number[at(column)];
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
}

// Gives the ring's patches these knots and rows of columns.
void set_rows(SurfaceNetwork& network, const StripRing& ring, const KnotVector& u,
              const Eigen::MatrixXi& columns) {
  for (std::size_t k = 0; k < ring.patches.size(); ++k) {
    Patch& patch = network.patches[at(ring.patches[k])];
    patch.u = u;
    patch.control.clear();
    for (Eigen::Index i = 0; i < columns.rows(); ++i) {
      for (int j = 0; j <= kPerPatch; ++j) {
        patch.control.push_back(columns(i, (kPerPatch * static_cast<int>(k) + j) % ring.points()));
      }
    }
  }
}

// Places along a ring that are equally far apart on its axis: parameters u, and distances as parts
// of the whole.
struct AxisSamples {
  std::vector<double> u, along;
  double length_mm = 0.0;
  double first_speed_mm = 0.0, last_speed_mm = 0.0;  // of the axis in u, at its ends
};

AxisSamples along_axis(const BSplineCurve<3>& axis, int count) {
  constexpr int kSteps = 32;  // of each span
  std::vector<double> u{axis.knots().first()}, length{0.0};
  const std::vector<double> breaks = axis.knots().breakpoints();
  Vec3 before = axis.at(u.front());
  for (std::size_t b = 0; b + 1 < breaks.size(); ++b) {
    for (int k = 1; k <= kSteps; ++k) {
      u.push_back(breaks[b] + (breaks[b + 1] - breaks[b]) * k / kSteps);
      const Vec3 p = axis.at(u.back());
      length.push_back(length.back() + (p - before).norm());
      before = p;
    }
  }
  AxisSamples samples;
  samples.length_mm = length.back();
  samples.first_speed_mm = axis.at(u.front(), 1).norm();
  samples.last_speed_mm = axis.at(u.back(), 1).norm();
  std::size_t k = 1;
  for (int i = 0; i < count; ++i) {
    const double part = static_cast<double>(i) / (count - 1);
    const double wanted = part * length.back();
    while (k + 1 < length.size() && length[k] < wanted) ++k;
    const double step = length[k] - length[k - 1];
    const double t = step > 0 ? std::clamp((wanted - length[k - 1]) / step, 0.0, 1.0) : 0.0;
    samples.u.push_back(u[k - 1] + t * (u[k] - u[k - 1]));
    samples.along.push_back(part);
  }
  return samples;
}

// The ring over the length of its axis instead of u, which wanders where the seed was drawn
// through sections at unequal distances, and then over as few knots as the tolerance allows.
// Nothing if it cannot be said so with the same number of knots.
std::optional<DirectionResult> reduced_ring(const SurfaceNetwork& network, const StripRing& ring,
                                            double tolerance_mm) {
  constexpr int kSamples = 4;          // of each span
  constexpr double kFineShare = 0.25;  // of the tolerance, for the change of parameter
  const int n = ring.points();
  std::vector<BSplineCurve<3>> lines;
  Points3 center = Points3::Zero(3, ring.rows());
  for (int c = 0; c < n; ++c) {
    Points3 points(3, ring.rows());
    for (int i = 0; i < ring.rows(); ++i) {
      points.col(i) = network.control_points_mm.col(ring.columns(i, c));
    }
    center += points / n;
    lines.emplace_back(ring.u, points);
  }
  const int spans = 2 * (ring.rows() - kPerPatch);
  std::vector<double> breaks;
  for (int k = 0; k <= spans; ++k) breaks.push_back(static_cast<double>(k) / spans);
  const KnotVector knots = KnotVector::clamped(kPerPatch, breaks);
  const AxisSamples at_axis = along_axis(BSplineCurve<3>(ring.u, center), kSamples * spans + 1);
  if (!(at_axis.first_speed_mm > 0 && at_axis.last_speed_mm > 0)) return {};
  Points3 rows(3, static_cast<Eigen::Index>(knots.control_point_count()) * n);
  double farthest = 0;
  for (int c = 0; c < n; ++c) {
    const BSplineCurve<3>& line = lines[at(c)];
    Points3 points(3, static_cast<Eigen::Index>(at_axis.u.size()));
    for (std::size_t k = 0; k < at_axis.u.size(); ++k) {
      points.col(static_cast<Eigen::Index>(k)) = line.at(at_axis.u[k]);
    }
    CurveFitOptions<3> held;
    const double first = ring.u.first(), last = ring.u.last();
    held.first = {line.at(first),
                  Vec3(line.at(first, 1) * at_axis.length_mm / at_axis.first_speed_mm)};
    held.last = {line.at(last), Vec3(line.at(last, 1) * at_axis.length_mm / at_axis.last_speed_mm)};
    const auto fit = fit_curve<3>(knots, at_axis.along, points, held);
    if (!fit) return {};
    farthest = std::max(farthest, fit->largest_residual);
    for (int i = 0; i < knots.control_point_count(); ++i) {
      rows.col(i * n + c) = fit->curve.control_points().col(i);
    }
  }
  if (farthest > kFineShare * tolerance_mm) return {};
  const std::vector<Knot> kept;
  return reduce_direction({.knots = knots,
                           .points = rows.data(),
                           .stride = 3 * n,
                           .group = 3,
                           .tolerance = (1 - kFineShare) * tolerance_mm,
                           .held_first = kHeld,
                           .held_last = kHeld,
                           .kept = kept,
                           .polish = 1});
}

}  // namespace

SurfaceNetwork with_fewer_knots(const SurfaceNetwork& network, double tolerance_mm) {
  EXPECTS(tolerance_mm > 0);
  SurfaceNetwork fewer = network;
  std::vector<StripRing> rings;
  for (StripRing& ring : strip_rings(network)) {
    const bool body = network.regions[at(ring.region)].kind == RegionKind::kBody;
    if (body && ring.rows() > kPerPatch + 1) rings.push_back(std::move(ring));
  }
  std::vector<std::optional<DirectionResult>> reduced(rings.size());
  tbb::parallel_for(std::size_t{0}, rings.size(), [&](std::size_t r) {
    reduced[r] = reduced_ring(network, rings[r], tolerance_mm);
  });
  std::vector<Vec3> pool;
  for (Eigen::Index c = 0; c < network.control_points_mm.cols(); ++c) {
    pool.push_back(network.control_points_mm.col(c));
  }
  for (std::size_t r = 0; r < rings.size(); ++r) {
    const StripRing& ring = rings[r];
    const int n = ring.points(),
              rows = reduced[r] ? reduced[r]->knots.control_point_count() : ring.rows();
    if (rows >= ring.rows()) continue;
    Eigen::MatrixXi columns(rows, n);
    columns.row(0) = ring.columns.row(0);
    columns.row(rows - 1) = ring.columns.row(ring.rows() - 1);
    for (int i = 1; i + 1 < rows; ++i) {
      for (int c = 0; c < n; ++c) {
        columns(i, c) = static_cast<int>(pool.size());
        pool.emplace_back(reduced[r]->points.data() + 3 * (i * n + c));
      }
    }
    set_rows(fewer, ring, reduced[r]->knots, columns);
  }
  fewer.control_points_mm =
      Eigen::Map<const Points3>(pool.data()->data(), 3, static_cast<Eigen::Index>(pool.size()));
  compact(fewer);
  return fewer;
}

SurfaceNetwork with_finer_bodies(const SurfaceNetwork& network, double radii) {
  SurfaceNetwork finer = network;
  std::vector<Vec3> pool;
  for (Eigen::Index c = 0; c < network.control_points_mm.cols(); ++c) {
    pool.push_back(network.control_points_mm.col(c));
  }
  for (const StripRing& ring : strip_rings(network)) {
    if (network.regions[at(ring.region)].kind != RegionKind::kBody) continue;
    const std::vector<double> added = finer_knots(network, ring, radii);
    if (added.empty()) continue;
    const KnotVector u = with_knots(ring.u, added).value();
    const int rows = u.control_point_count();
    Eigen::MatrixXi columns(rows, ring.points());
    columns.row(0) = ring.columns.row(0);
    columns.row(rows - 1) = ring.columns.row(ring.rows() - 1);
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
  compact(finer);
  return finer;
}

}  // namespace angiospline
