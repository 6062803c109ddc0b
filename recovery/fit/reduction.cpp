#include "recovery/fit/reduction.h"

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
#include "kernel/spline/basis.h"

namespace angiospline {
namespace {

// Unit normal of the plane of a closed polygon (Newell).
Vec3 plane_of_row(const Points3& row) {
  Vec3 normal = Vec3::Zero();
  for (Eigen::Index k = 0; k < row.cols(); ++k) {
    normal += Vec3(row.col(k)).cross(Vec3(row.col((k + 1) % row.cols())));
  }
  return normal.normalized();
}

// A body cut across. Its rings of control points along u are sections that may lean this way and
// that: planes across a smooth axis give sections that do not, and so need few knots.
class CrossSections {
 public:
  CrossSections(const SurfaceNetwork& network, const StripRing& ring)
      : ring_(ring), n_(ring.points()), basis_(ring.basis()) {
    for (const int p : ring.patches) patches_.push_back(patch_surface(network, p));
    Points3 centers = Points3::Zero(3, ring.rows());
    for (int i = 0; i < ring.rows(); ++i) {
      rows_.emplace_back(3, n_);
      for (int c = 0; c < n_; ++c) {
        rows_.back().col(c) = network.control_points_mm.col(ring.columns(i, c));
      }
      centers.col(i) = rows_.back().rowwise().mean();
    }
    find_axis(BSplineCurve<3>(ring.u, centers));
    weights_ = Eigen::MatrixXd::Zero(kAround * std::ssize(patches_), n_);
    for (std::size_t k = 0; k < patches_.size(); ++k) {
      for (int a = 0; a < kAround; ++a) {
        const BasisValues b = basis_at(patches_[k].v(), static_cast<double>(a) / kAround, 0);
        for (int j = 0; j <= kPerPatch; ++j) {
          weights_(static_cast<Eigen::Index>(k) * kAround + a,
                   (kPerPatch * static_cast<int>(k) + j) % n_) += b.values(0, j);
        }
      }
    }
    solver_.compute(weights_ * basis_);
  }

  // Points of the section at a fraction of the axis with the surface's normals there, one row each,
  // and the ring of control points nearest to them; nothing if the plane does not cross every line
  // along the body.
  struct Section {
    Eigen::MatrixXd points, normals;
    Points3 ring;
  };
  std::optional<Section> at_fraction(double t) const {
    const double s = std::clamp(t, 0.0, 1.0);
    const Vec3 a = axis_->at(s), normal = axis_->at(s, 1).normalized();
    Section section{Eigen::MatrixXd(weights_.rows(), 3), Eigen::MatrixXd(weights_.rows(), 3), {}};
    for (std::size_t k = 0; k < patches_.size(); ++k) {
      for (int j = 0; j < kAround; ++j) {
        const double v = static_cast<double>(j) / kAround;
        const auto u = t <= 0   ? std::optional(ring_.u.first())
                       : t >= 1 ? std::optional(ring_.u.last())
                                : cut(patches_[k], v, a, normal, guess(t));
        if (!u) return {};
        const auto row = static_cast<Eigen::Index>(k) * kAround + j;
        section.points.row(row) = patches_[k].at(*u, v).transpose();
        section.normals.row(row) = normal_vector(patches_[k], *u, v).normalized().transpose();
      }
    }
    section.ring = (basis_ * solver_.solve(section.points)).transpose();
    if (t <= 0) section.ring = rows_.front();
    if (t >= 1) section.ring = rows_.back();
    return section;
  }

  // How far a ring of control points is from a section, along its normals.
  double distance_mm(const Section& section, const Points3& ring) const {
    const Eigen::MatrixXd off = weights_ * ring.transpose() - section.points;
    return off.cwiseProduct(section.normals).rowwise().sum().cwiseAbs().maxCoeff();
  }

  // The derivative along the axis, over its fraction, that all points of an end have to keep so
  // that tangent planes there contain the axis; nothing if they do not contain it now.
  std::optional<Vec3> held_derivative(bool at_end) const {
    const Points3& edge = at_end ? rows_.back() : rows_.front();
    const Points3& next = at_end ? rows_[rows_.size() - 2] : rows_[1];
    const Vec3 along = axis_->at(at_end ? 1.0 : 0.0, 1);
    for (int c = 0; c < n_; ++c) {
      const Vec3 step = next.col(c) - edge.col(c);
      if (step.cross(along).norm() > 1e-6 * step.norm() * along.norm()) return {};
    }
    return Vec3(length_ * along.normalized());
  }

 private:
  static constexpr int kAround = 8;  // places of a section, on each patch

  // A smooth curve through the rings' centres, square to both ends' planes, over its length.
  void find_axis(const BSplineCurve<3>& centers) {
    constexpr int kSteps = 16;          // of each span
    constexpr double kRowsASpan = 3.0;  // of the smooth axis
    const std::vector<double> breaks = ring_.u.breakpoints();
    std::vector<Vec3> points{centers.at(breaks.front())};
    us_ = {breaks.front()};
    lengths_ = {0.0};
    for (std::size_t b = 0; b + 1 < breaks.size(); ++b) {
      for (int k = 1; k <= kSteps; ++k) {
        us_.push_back(breaks[b] + (breaks[b + 1] - breaks[b]) * k / kSteps);
        points.push_back(centers.at(us_.back()));
        lengths_.push_back(lengths_.back() + (points.back() - points[points.size() - 2]).norm());
      }
    }
    length_ = lengths_.back();
    if (!(length_ > 0)) return;
    for (double& l : lengths_) l /= length_;
    const int spans = std::max(1, static_cast<int>(ring_.rows() / kRowsASpan) - 1);
    std::vector<double> ends;
    for (int k = 0; k <= spans; ++k) ends.push_back(static_cast<double>(k) / spans);
    CurveFitOptions<3> held;
    const auto out = [&](const Points3& row, double t) -> Vec3 {
      const Vec3 normal = plane_of_row(row);
      const Vec3 along = t == 0 ? points[1] - points[0] : points.back() - points[points.size() - 2];
      return normal.dot(along) < 0 ? -length_ * normal : length_ * normal;
    };
    held.first = {points.front(), out(rows_.front(), 0)};
    held.last = {points.back(), out(rows_.back(), 1)};
    const Points3 all = Eigen::Map<const Points3>(points.front().data(), 3,
                                                  static_cast<Eigen::Index>(points.size()));
    const auto fit = fit_curve<3>(KnotVector::clamped(kPerPatch, ends), lengths_, all, held);
    if (fit) axis_ = fit->curve;
  }

  double guess(double t) const {
    const auto next = std::lower_bound(lengths_.begin(), lengths_.end(), t);
    return us_[index(std::min(next - lengths_.begin(), std::ssize(us_) - 1))];
  }

  // Where the line v of a patch crosses a plane, by Newton's steps within the patch.
  static std::optional<double> cut(const BSplineSurface<3>& patch, double v, const Vec3& a,
                                   const Vec3& normal, double u) {
    const double first = patch.u().first(), last = patch.u().last();
    for (int k = 0; k < 30; ++k) {
      const SurfaceJet jet = surface_jet(patch, u, v);
      const double off = normal.dot(jet.point - a), slope = normal.dot(jet.u);
      if (!(slope > 0)) return {};
      const double next = std::clamp(u - off / slope, first, last);
      if (std::abs(next - u) < 1e-12 * (last - first)) {
        if (std::abs(off) > 1e-7 * jet.u.norm() * (last - first)) return {};
        return next;
      }
      u = next;
    }
    return {};
  }

  const StripRing& ring_;
  int n_;
  Eigen::MatrixXd basis_;
  Eigen::MatrixXd weights_;  // of a ring's control points, for each place around it
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> solver_;
  std::vector<BSplineSurface<3>> patches_;
  std::vector<Points3> rows_;
  std::vector<double> us_, lengths_;  // of the rings' centres; lengths are fractions
  double length_ = 0.0;
  std::optional<BSplineCurve<3>> axis_;

 public:
  bool has_axis() const { return axis_.has_value(); }
};

struct ReducedRing {
  KnotVector knots;
  std::vector<Points3> rows;
};

// The body over the length of its axis with the fewest equal spans, of a growing series, that leave
// it within the tolerance along its normals. Nothing if that takes as many as it has.
std::optional<ReducedRing> reduced_ring(const SurfaceNetwork& network, const StripRing& ring,
                                        double tolerance_mm) {
  constexpr int kSections = 4;        // for each row of the ring
  constexpr double kLeastStep = 0.7;  // of the steps between sections
  const CrossSections sections(network, ring);
  if (!sections.has_axis()) return {};
  std::vector<double> places;
  std::vector<CrossSections::Section> cuts;
  const int count = kSections * ring.rows();
  for (int k = 0; k <= count; ++k) {
    places.push_back(static_cast<double>(k) / count);
    auto section = sections.at_fraction(places.back());
    if (!section || sections.distance_mm(*section, section->ring) > tolerance_mm) return {};
    cuts.push_back(std::move(*section));
  }
  const int n = ring.points();
  for (int spans = 1; spans + kPerPatch < ring.rows(); spans = std::max(spans + 1, spans * 5 / 4)) {
    std::vector<double> breaks;
    for (int k = 0; k <= spans; ++k) breaks.push_back(static_cast<double>(k) / spans);
    ReducedRing reduced{KnotVector::clamped(kPerPatch, breaks), {}};
    std::vector<Points3> trial(cuts.size(), Points3(3, n));
    reduced.rows.assign(index(reduced.knots.control_point_count()), Points3(3, n));
    bool solved = true;
    for (int c = 0; c < n && solved; ++c) {
      Points3 points(3, static_cast<Eigen::Index>(cuts.size()));
      for (std::size_t k = 0; k < cuts.size(); ++k) {
        points.col(static_cast<Eigen::Index>(k)) = cuts[k].ring.col(c);
      }
      CurveFitOptions<3> held;
      held.first = {Vec3(cuts.front().ring.col(c)), sections.held_derivative(false)};
      held.last = {Vec3(cuts.back().ring.col(c)), sections.held_derivative(true)};
      const auto fit = fit_curve<3>(reduced.knots, places, points, held);
      solved = fit.has_value();
      if (!solved) break;
      for (std::size_t i = 0; i < reduced.rows.size(); ++i) {
        reduced.rows[i].col(c) = fit->curve.control_points().col(static_cast<Eigen::Index>(i));
      }
      for (std::size_t k = 0; k < cuts.size(); ++k) trial[k].col(c) = fit->curve.at(places[k]);
    }
    double farthest = 0;
    for (std::size_t k = 0; k < cuts.size() && solved; ++k) {
      farthest = std::max(farthest, sections.distance_mm(cuts[k], trial[k]));
    }
    // Steps along every line keep most of what they were: nothing comes near to folding.
    bool sound = solved;
    for (std::size_t k = 0; k + 1 < cuts.size() && sound; ++k) {
      for (int c = 0; c < n && sound; ++c) {
        const Vec3 step = cuts[k + 1].ring.col(c) - cuts[k].ring.col(c);
        const Vec3 now = trial[k + 1].col(c) - trial[k].col(c);
        sound = now.dot(step) >= kLeastStep * step.squaredNorm();
      }
    }
    if (sound && farthest <= tolerance_mm) return reduced;
  }
  return {};
}

}  // namespace

SurfaceNetwork with_fewer_knots(const SurfaceNetwork& network, double tolerance_mm) {
  EXPECTS(tolerance_mm > 0);
  SurfaceNetwork fewer = network;
  std::vector<StripRing> rings;
  for (StripRing& ring : strip_rings(network)) {
    const bool body = network.regions[index(ring.region)].kind == RegionKind::kBody;
    if (body && ring.rows() > kPerPatch + 1) rings.push_back(std::move(ring));
  }
  std::vector<std::optional<ReducedRing>> reduced(rings.size());
  tbb::parallel_for(std::size_t{0}, rings.size(), [&](std::size_t r) {
    reduced[r] = reduced_ring(network, rings[r], tolerance_mm);
  });
  std::vector<Vec3> pool;
  for (Eigen::Index c = 0; c < network.control_points_mm.cols(); ++c) {
    pool.push_back(network.control_points_mm.col(c));
  }
  for (std::size_t r = 0; r < rings.size(); ++r) {
    const StripRing& ring = rings[r];
    if (!reduced[r]) continue;
    const int n = ring.points(), rows = reduced[r]->knots.control_point_count();
    Eigen::MatrixXi columns(rows, n);
    columns.row(0) = ring.columns.row(0);
    columns.row(rows - 1) = ring.columns.row(ring.rows() - 1);
    for (int i = 1; i + 1 < rows; ++i) {
      for (int c = 0; c < n; ++c) {
        columns(i, c) = static_cast<int>(pool.size());
        pool.emplace_back(reduced[r]->rows[index(i)].col(c));
      }
    }
    set_rows(fewer, ring, reduced[r]->knots, columns);
  }
  fewer.control_points_mm =
      Eigen::Map<const Points3>(pool.data()->data(), 3, static_cast<Eigen::Index>(pool.size()));
  return compacted(std::move(fewer));
}

}  // namespace angiospline
