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
#include "recovery/fit/rules.h"

namespace angiospline {
namespace {

using namespace fit_rules;

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

    // A place of a section as a row over the ring's control points.
    weights_ = Eigen::MatrixXd::Zero(kReduction.around * std::ssize(patches_), n_);
    for (std::size_t k = 0; k < patches_.size(); ++k) {
      for (int a = 0; a < kReduction.around; ++a) {
        const BasisValues b =
            basis_at(patches_[k].v(), static_cast<double>(a) / kReduction.around, 0);
        for (int j = 0; j <= kPerPatch; ++j) {
          weights_(static_cast<Eigen::Index>(k) * kReduction.around + a,
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
      for (int j = 0; j < kReduction.around; ++j) {
        const double v = static_cast<double>(j) / kReduction.around;
        const auto u = t <= 0   ? std::optional(ring_.u.first())
                       : t >= 1 ? std::optional(ring_.u.last())
                                : cut(patches_[k], v, a, normal, guess(t));
        if (!u) return {};
        const auto row = static_cast<Eigen::Index>(k) * kReduction.around + j;
        section.points.row(row) = patches_[k].at(*u, v).transpose();
        section.normals.row(row) = normal_vector(patches_[k], *u, v).normalized().transpose();
      }
    }

    // The ring nearest to these points that keeps its seams; at the ends the rows themselves.
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
  // A smooth curve through the rings' centres, square to both ends' planes, over its length.
  void find_axis(const BSplineCurve<3>& centers) {
    // The curve of the centres over its length, as a polygon.
    const std::vector<double> breaks = ring_.u.breakpoints();
    std::vector<Vec3> points{centers.at(breaks.front())};
    us_ = {breaks.front()};
    lengths_ = {0.0};
    for (std::size_t b = 0; b + 1 < breaks.size(); ++b) {
      for (int k = 1; k <= kReduction.steps_a_span; ++k) {
        us_.push_back(breaks[b] + (breaks[b + 1] - breaks[b]) * k / kReduction.steps_a_span);
        points.push_back(centers.at(us_.back()));
        lengths_.push_back(lengths_.back() + (points.back() - points[points.size() - 2]).norm());
      }
    }
    length_ = lengths_.back();
    if (!(length_ > 0)) return;
    for (double& l : lengths_) l /= length_;

    // A smooth axis: a third of the rows' freedom, square to the planes of both ends.
    const int spans = std::max(1, static_cast<int>(ring_.rows() / kReduction.rows_a_span) - 1);
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

      // A line that ends before the plane comes to rest at its end, away from it.
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

// The body's sections at even places of its axis; none if one of them is not within the tolerance
// of its own ring, or the planes do not cut the body across.
struct Cuts {
  std::vector<double> places;
  std::vector<CrossSections::Section> sections;
};
std::optional<Cuts> even_cuts(const CrossSections& body, int count, double tolerance_mm) {
  Cuts cuts;
  for (int k = 0; k <= count; ++k) {
    cuts.places.push_back(static_cast<double>(k) / count);
    auto section = body.at_fraction(cuts.places.back());
    if (!section || body.distance_mm(*section, section->ring) > tolerance_mm) return {};
    cuts.sections.push_back(std::move(*section));
  }
  return cuts;
}

// A body on fewer knots, and its rings of control points at the cuts.
struct Trial {
  ReducedRing reduced;
  std::vector<Points3> rings;
};

// Every line of control points along the body fitted with so many equal spans, ends held; nothing
// if a fit cannot be solved.
std::optional<Trial> trial_with(int spans, const CrossSections& body, const Cuts& cuts,
                                int points) {
  std::vector<double> breaks;
  for (int k = 0; k <= spans; ++k) breaks.push_back(static_cast<double>(k) / spans);
  Trial trial{{KnotVector::clamped(kPerPatch, breaks), {}},
              std::vector<Points3>(cuts.sections.size(), Points3(3, points))};
  ReducedRing& reduced = trial.reduced;
  reduced.rows.assign(index(reduced.knots.control_point_count()), Points3(3, points));

  for (int c = 0; c < points; ++c) {
    Points3 line(3, std::ssize(cuts.sections));
    for (std::size_t k = 0; k < cuts.sections.size(); ++k) {
      line.col(static_cast<Eigen::Index>(k)) = cuts.sections[k].ring.col(c);
    }
    CurveFitOptions<3> held;
    held.first = {Vec3(cuts.sections.front().ring.col(c)), body.held_derivative(false)};
    held.last = {Vec3(cuts.sections.back().ring.col(c)), body.held_derivative(true)};
    const auto fit = fit_curve<3>(reduced.knots, cuts.places, line, held);
    if (!fit) return {};

    for (std::size_t i = 0; i < reduced.rows.size(); ++i) {
      reduced.rows[i].col(c) = fit->curve.control_points().col(static_cast<Eigen::Index>(i));
    }
    for (std::size_t k = 0; k < cuts.sections.size(); ++k) {
      trial.rings[k].col(c) = fit->curve.at(cuts.places[k]);
    }
  }
  return trial;
}

// Whether steps along every line keep most of what they were: nothing comes near to folding.
bool keeps_steps(const Trial& trial, const Cuts& cuts) {
  for (std::size_t k = 0; k + 1 < cuts.sections.size(); ++k) {
    for (Eigen::Index c = 0; c < trial.rings[k].cols(); ++c) {
      const Vec3 step = cuts.sections[k + 1].ring.col(c) - cuts.sections[k].ring.col(c);
      const Vec3 now = trial.rings[k + 1].col(c) - trial.rings[k].col(c);
      if (!(now.dot(step) >= kReduction.least_step * step.squaredNorm())) return false;
    }
  }
  return true;
}

// The body over the length of its axis with the fewest equal spans, of a growing series, that leave
// it within the tolerance along its normals. Nothing if that takes as many as it has.
std::optional<ReducedRing> reduced_ring(const SurfaceNetwork& network, const StripRing& ring,
                                        double tolerance_mm) {
  const CrossSections body(network, ring);
  if (!body.has_axis()) return {};
  const auto cuts = even_cuts(body, kReduction.sections_a_row * ring.rows(), tolerance_mm);
  if (!cuts) return {};

  for (int spans = 1; spans + kPerPatch < ring.rows(); spans = std::max(spans + 1, spans * 5 / 4)) {
    auto trial = trial_with(spans, body, *cuts, ring.points());
    if (!trial || !keeps_steps(*trial, *cuts)) continue;

    double farthest = 0;
    for (std::size_t k = 0; k < cuts->sections.size(); ++k) {
      farthest = std::max(farthest, body.distance_mm(cuts->sections[k], trial->rings[k]));
    }
    if (farthest <= tolerance_mm) return std::move(trial->reduced);
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

  // New columns between the end rows, which bodies share with junctions and rims.
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
