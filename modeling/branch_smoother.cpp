#include "modeling/branch_smoother.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <Eigen/Geometry>

#include "base/contract.h"
#include "modeling/penalised_spline.h"

namespace angiospline {
namespace {

constexpr int kDegree = 5;
constexpr int kFewestSamples = 5;     // sparser branches get points between their points
constexpr double kSpanRadii = 0.5;    // knots of the smoothing spline need not lie closer
constexpr int kMostSpans = 20000;     // of one branch
constexpr double kLeastNoise = 1e-3;  // in mean radii: far below any voxel, above rounding
constexpr int kRelaxations = 16;      // halvings of a strength that moves points too far
constexpr int kStiffenings = 24;      // doublings of the stiffness where a bend is too sharp
constexpr int kBendSamples = 6;       // of curvature, for each span

struct Samples {
  Eigen::MatrixXd points;  // one row a sample
  Eigen::VectorXd radii;
  Eigen::VectorXd parameters;
  Eigen::VectorXd radius_weights;
};

std::vector<double> uniform(double last, int spans) {
  std::vector<double> breaks(static_cast<std::size_t>(spans) + 1);
  for (int k = 0; k <= spans; ++k) breaks[static_cast<std::size_t>(k)] = last * k / spans;
  return breaks;
}

// Whether the first radius belongs to what comes before: it jumps to the second, and more than the
// radii vary after it.
bool jumps(double r0, double r1, double r2) {
  constexpr double kJump = 0.05;
  return std::abs(std::log(r0 / r1)) > kJump + 3 * std::abs(std::log(r1 / r2));
}

Samples samples_of(const CenterlineBranch& branch, bool trust_start, bool trust_end) {
  const Eigen::Index given = branch.points_mm.cols();
  const Eigen::Index parts =
      given >= kFewestSamples ? 1 : (kFewestSamples - 1 + given - 2) / (given - 1);
  const Eigen::Index count = (given - 1) * parts + 1;
  Samples s;
  s.points.resize(count, 3);
  s.radii.resize(count);
  s.parameters.resize(count);
  s.radius_weights = Eigen::VectorXd::Ones(count);
  for (Eigen::Index k = 0; k < count; ++k) {
    const Eigen::Index i = std::min(k / parts, given - 2);
    const double t = static_cast<double>(k - i * parts) / static_cast<double>(parts);
    s.points.row(k) =
        ((1 - t) * branch.points_mm.col(i) + t * branch.points_mm.col(i + 1)).transpose();
    s.radii(k) = (1 - t) * branch.radii_mm(i) + t * branch.radii_mm(i + 1);
    s.parameters(k) =
        k == 0 ? 0.0 : s.parameters(k - 1) + (s.points.row(k) - s.points.row(k - 1)).norm();
  }
  const auto& r = branch.radii_mm;
  if (given > 3) {
    if (!trust_start && jumps(r(0), r(1), r(2))) s.radius_weights(0) = 0;
    if (!trust_end && jumps(r(given - 1), r(given - 2), r(given - 3))) {
      s.radius_weights(count - 1) = 0;
    }
  }
  return s;
}

int span_count(const Samples& s) {
  const double length = s.parameters(s.parameters.size() - 1);
  const double by_radius = length / (kSpanRadii * s.radii.mean());
  const double by_samples = 2.0 * static_cast<double>(s.parameters.size() - 1);
  return static_cast<int>(std::clamp(std::min(by_radius, by_samples), 2.0, double{kMostSpans}));
}

Eigen::MatrixXd two_rows(const Vec3& a, const Vec3& b) {
  Eigen::MatrixXd rows(2, 3);
  rows.row(0) = a.transpose();
  rows.row(1) = b.transpose();
  return rows;
}

double bend(const BSplineCurve<4>& path, double s) {
  const Vec3 d1 = path.at(s, 1).head<3>();
  const Vec3 d2 = path.at(s, 2).head<3>();
  const double speed = d1.norm();
  if (!(speed > 0)) return std::numeric_limits<double>::infinity();
  return d1.cross(d2).norm() / (speed * speed * speed) * path.at(s)(3);
}

}  // namespace

struct BranchSmoother::State {
  State(const CenterlineBranch& branch, bool trust_start, bool trust_end,
        const BranchSmootherOptions& opts)
      : options(opts),
        samples(samples_of(branch, trust_start, trust_end)),
        knots(KnotVector::clamped(
            kDegree,
            uniform(samples.parameters(samples.parameters.size() - 1), span_count(samples)))),
        position(knots, samples.parameters, samples.points,
                 Eigen::VectorXd::Ones(samples.parameters.size())),
        log_radius(knots, samples.parameters, samples.radii.array().log().matrix(),
                   samples.radius_weights) {
    position_strength = position.best_strength(kLeastNoise * samples.radii.mean());
    log_radius_coefficients = log_radius.solve(log_radius.best_strength(kLeastNoise));
    free = position.solve(position_strength);
  }

  // How far the samples lie from the curve at their parameters, in mm and in radii.
  std::pair<double, double> moves(const Eigen::MatrixXd& C) const {
    const BSplineCurve<3> curve(knots, C.transpose());
    std::pair<double, double> most{0, 0};
    for (Eigen::Index i = 0; i < samples.parameters.size(); ++i) {
      const double d = (curve.at(samples.parameters(i)) - samples.points.row(i).transpose()).norm();
      most.first = std::max(most.first, d);
      most.second = std::max(most.second, d / samples.radii(i));
    }
    return most;
  }

  double radius_at(double t) const {
    return std::exp(BSplineCurve<1>(knots, log_radius_coefficients.transpose()).at(t)(0));
  }

  // The same curve with its radius as one path in near arc length, with as few spans as the
  // tolerance allows.
  BSplineCurve<4> path_of(const Eigen::MatrixXd& C) const {
    const BSplineCurve<3> curve(knots, C.transpose());
    const BSplineCurve<1> log_r(knots, log_radius_coefficients.transpose());
    const int spans = position.span_count();
    const int count = std::max(8 * spans, 64);
    const double last = knots.last();
    Eigen::VectorXd s(count + 1);
    Eigen::MatrixXd values(count + 1, 4);
    constexpr std::array<double, 3> kAt = {0.1127016653792583, 0.5, 0.8872983346207417};
    constexpr std::array<double, 3> kWeight = {5.0 / 18, 8.0 / 18, 5.0 / 18};
    for (int k = 0; k <= count; ++k) {
      const double t = last * k / count;
      if (k == 0) s(0) = 0;
      double step = 0;
      for (std::size_t g = 0; k > 0 && g < kAt.size(); ++g) {
        step += kWeight[g] * curve.at(t - last / count * (1 - kAt[g]), 1).norm();
      }
      if (k > 0) s(k) = s(k - 1) + step * last / count;
      values.row(k).head<3>() = curve.at(t).transpose();
      values(k, 3) = std::exp(log_r.at(t)(0));
    }
    for (int n = 2;; n = std::max(n + 1, n * 5 / 4)) {
      const bool full = n >= spans + 4;
      const KnotVector fewer =
          KnotVector::clamped(kDegree, uniform(s(count), full ? spans + 4 : n));
      const PenalisedSpline fit(fewer, s, values, Eigen::VectorXd::Ones(count + 1));
      Eigen::MatrixXd ends(2, 4);
      ends.row(0) = values.row(0);
      ends.row(1) = values.row(count);
      constexpr double kNoPenalty = 1e-9;  // times length^3: regularises, does not smooth
      const double length = s(count);
      BSplineCurve<4> path(
          fewer,
          fit.solve(kNoPenalty * length * length * length / std::pow(n, 4), ends).transpose());
      double worst = 0;
      for (int k = 0; k <= count; ++k) {
        const Vec4 d = path.at(s(k)) - values.row(k).transpose();
        worst = std::max(worst, std::max(d.head<3>().norm(), std::abs(d(3))) / values(k, 3));
      }
      if (full || worst <= options.path_tolerance) return path;
    }
  }

  BranchSmootherOptions options;
  Samples samples;
  KnotVector knots;
  PenalisedSpline position;
  PenalisedSpline log_radius;
  double position_strength = 0;
  Eigen::MatrixXd log_radius_coefficients;
  Eigen::MatrixXd free;
};

BranchSmoother::BranchSmoother(const CenterlineBranch& branch, bool trust_start, bool trust_end,
                               const BranchSmootherOptions& options) {
  EXPECTS(branch.points_mm.cols() >= 2 && branch.radii_mm.minCoeff() > 0);
  state_ = std::make_unique<State>(branch, trust_start, trust_end, options);
}

BranchSmoother::~BranchSmoother() = default;
BranchSmoother::BranchSmoother(BranchSmoother&&) noexcept = default;
BranchSmoother& BranchSmoother::operator=(BranchSmoother&&) noexcept = default;

std::pair<Vec3, Vec3> BranchSmoother::free_ends() const {
  return {state_->free.row(0).transpose(), state_->free.bottomRows(1).transpose()};
}

std::pair<double, double> BranchSmoother::end_radii_mm() const {
  return {state_->radius_at(state_->knots.first()), state_->radius_at(state_->knots.last())};
}

SmoothPath BranchSmoother::smooth(const Vec3& start, const Vec3& end) const {
  PenalisedSpline position = state_->position;
  const Eigen::MatrixXd ends = two_rows(start, end);
  double strength = state_->position_strength;
  Eigen::MatrixXd C = position.solve(strength, ends);
  for (int k = 0; k < kRelaxations && state_->moves(C).second > state_->options.largest_move; ++k) {
    strength *= 0.25;
    C = position.solve(strength, ends);
  }
  const auto sharpest = [](const BSplineCurve<4>& path) {
    double most = 0;
    const int count = path.knots().control_point_count() * kBendSamples;
    for (int i = 0; i <= count; ++i) {
      most = std::max(most, bend(path, path.knots().last() * i / count));
    }
    return most;
  };
  SmoothPath found{state_->path_of(C), 0, 0, 0};
  found.sharpest_bend = sharpest(found.path);
  for (int k = 0; k < kStiffenings && found.sharpest_bend > state_->options.largest_bend; ++k) {
    strength *= 2;
    const Eigen::MatrixXd stiffer = position.solve(strength, ends);
    if (state_->moves(stiffer).second > state_->options.largest_move) break;
    BSplineCurve<4> path = state_->path_of(stiffer);
    const double now = sharpest(path);
    if (now >= found.sharpest_bend) continue;
    C = stiffer;
    found.path = std::move(path);
    found.sharpest_bend = now;
  }
  std::tie(found.largest_move_mm, found.largest_move_radii) = state_->moves(C);
  return found;
}

}  // namespace angiospline
