#include "modeling/tree/branch_smoother.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "base/contract.h"
#include "base/index.h"
#include "kernel/fit/penalised_spline.h"
#include "modeling/tree/branch_radii.h"
#include "modeling/tree/branch_rules.h"
#include "modeling/tree/branch_samples.h"
#include "modeling/tree/rules.h"

namespace angiospline {
namespace {

// A quadratic through the least value and its neighbours.
double parabola_vertex(const Eigen::VectorXd& v, Eigen::Index k) {
  if (k == 0 || k + 1 >= v.size()) return static_cast<double>(k);
  const double below = v(k - 1) - v(k);
  const double above = v(k + 1) - v(k);
  if (!(below + above > 0) || !std::isfinite(below + above)) return static_cast<double>(k);
  return static_cast<double>(k) + 0.5 * (below - above) / (below + above);
}

// A strength from its place on the grid.
double strength(double unit, double grid_position) {
  return unit * std::pow(10.0, kFirstStrength + kStrengthStep * grid_position);
}

// The branch's verdict with a Gaussian prior around the tree's: criteria are minus twice a
// logarithm of likelihood, to which the prior adds its squared distance in standard deviations.
double drawn_to(double of_tree, double width, Eigen::VectorXd criteria) {
  for (Eigen::Index k = 0; k < criteria.size(); ++k) {
    const double off = (static_cast<double>(k) - of_tree) * kStrengthStep / width;
    criteria(k) += off * off;
  }
  return best_grid_position(criteria);
}

// The dense curve and its radius, sampled for the final path.
struct DensePath {
  Eigen::VectorXd s;       // arc length
  Eigen::MatrixXd values;  // x, y, z, radius
  Eigen::VectorXd bends;   // curvature times radius
};

// The curve over its arc length, which is summed by Gauss's rule with three points.
DensePath dense_path(const BSplineCurve<3>& curve, const PathLimits& limits) {
  const double last = limits.spline.knots().last();
  const int count =
      std::max(PathRules::kDenseSamples * limits.spline.span_count(), PathRules::kFewestDense);
  const double step = last / count;
  DensePath path{Eigen::VectorXd::Zero(count + 1), Eigen::MatrixXd(count + 1, 4),
                 Eigen::VectorXd::Zero(count + 1)};
  constexpr std::array<double, 3> kAt = {0.1127016653792583, 0.5, 0.8872983346207417};
  constexpr std::array<double, 3> kWeight = {5.0 / 18, 8.0 / 18, 5.0 / 18};
  for (int k = 0; k <= count; ++k) {
    const double t = k == count ? last : step * k;
    double speed = 0;
    for (std::size_t g = 0; k > 0 && g < kAt.size(); ++g) {
      speed += kWeight[g] * curve.at(t - step * (1 - kAt[g]), 1).norm();
    }
    if (k > 0) path.s(k) = path.s(k - 1) + step * speed;

    // Bends inside a junction reach no wall.
    path.values.row(k).head<3>() = curve.at(t).transpose();
    path.values(k, 3) = std::exp(limits.log_radius.at(t)(0));
    if (limits.is_visible(t)) {
      path.bends(k) = bend_from(curve.at(t, 1), curve.at(t, 2), path.values(k, 3));
    }
  }
  return path;
}

// Where a bend is still too sharp for the radius, the radius gives way, over two radii to either
// side. Returns the least factor.
double reduce_radius_in_bends(double largest_bend, DensePath& path) {
  const Eigen::Index count = path.s.size();
  Eigen::VectorXd factor = Eigen::VectorXd::Ones(count);
  for (Eigen::Index k = 0; k < count; ++k) {
    if (path.bends(k) <= largest_bend) continue;
    const double least = std::max(RadiusRules::kLeastFactor, largest_bend / path.bends(k));
    const double reach = RadiusRules::kReach * path.values(k, 3);
    for (const Eigen::Index step : {Eigen::Index{-1}, Eigen::Index{1}}) {
      for (Eigen::Index j = k; j >= 0 && j < count; j += step) {
        const double x = std::abs(path.s(j) - path.s(k)) / reach;
        if (x >= 1) break;
        factor(j) = std::min(factor(j), least + (1 - least) * x * x * (3 - 2 * x));
      }
    }
  }
  path.values.col(3).array() *= factor.array();
  path.bends.array() *= factor.array();
  return factor.minCoeff();
}

// The breakpoints with one more in the middle of each span on which the path misses the tolerance,
// as long as a half keeps enough samples to stand on. `off`: the misses at the samples.
std::vector<double> halved_where_off(const std::vector<double>& breaks, const DensePath& dense,
                                     const Eigen::MatrixXd& off, double tolerance, int degree) {
  const Eigen::Index last = dense.s.size() - 1;
  std::vector<double> finer;
  Eigen::Index k = 0;
  for (std::size_t b = 0; b + 1 < breaks.size(); ++b) {
    finer.push_back(breaks[b]);
    const Eigen::Index first = k;
    double worst = 0;
    for (; k <= last && (dense.s(k) < breaks[b + 1] || b + 2 == breaks.size()); ++k) {
      const double error = std::max(off.row(k).head<3>().norm(), std::abs(off(k, 3)));
      worst = std::max(worst, error / dense.values(k, 3));
    }
    const bool can_halve = k - first >= 2 * degree;
    if (worst > tolerance && can_halve) finer.push_back(0.5 * (breaks[b] + breaks[b + 1]));
  }
  finer.push_back(breaks.back());
  return finer;
}

// The path with few spans, through the first and last sample exactly.
BSplineCurve<4> compressed(const DensePath& dense, double tolerance, int degree) {
  const Eigen::Index last = dense.s.size() - 1;
  const double length = dense.s(last);
  Eigen::MatrixXd ends(2, 4);
  ends.row(0) = dense.values.row(0);
  ends.row(1) = dense.values.row(last);

  std::vector<double> breaks = even_breaks(length, 2);
  for (int round = 0;; ++round) {
    const KnotVector knots = KnotVector::clamped(degree, breaks);
    const PenalisedSpline fit(knots, dense.s, dense.values, Eigen::VectorXd::Ones(last + 1));
    const double strength =
        PathRules::kLeastStrength * std::pow(length / static_cast<double>(breaks.size() - 1), 3);
    const Eigen::MatrixXd C = fit.solve(strength, ends);
    const Eigen::MatrixXd off = fit.values_at_samples(C) - dense.values;
    std::vector<double> finer = halved_where_off(breaks, dense, off, tolerance, degree);
    if (finer.size() == breaks.size() || round == PathRules::kRefinements) {
      return BSplineCurve<4>(knots, C.transpose());
    }
    breaks = std::move(finer);
  }
}

}  // namespace

double best_grid_position(const Eigen::VectorXd& criteria) {
  Eigen::Index least = 0;
  criteria.minCoeff(&least);
  return parabola_vertex(criteria, least);
}

struct BranchSmoother::State {
  State(const CenterlineBranch& branch, const SmootherEnd& start_end, const SmootherEnd& end_end,
        double tree_radius, const BranchSmootherOptions& opts)
      : options(opts),
        start(start_end),
        end(end_end),
        samples(samples_of(branch, start.is_junction, end.is_junction)),
        position(knots_for(samples), samples.parameters, samples.points, samples.weights),
        radii(samples, position.knots()) {
    // Noise of a given size in the tree against curvatures of the order of one over the radius,
    // that stay alike over a radius; and relative noise of the radii against changes over a radius.
    const double mean = samples.radii.mean();
    position_unit = tree_radius * tree_radius * mean;
    radius_unit = mean * mean * mean;

    position_criteria.resize(kStrengthCount);
    radius_criteria.resize(kStrengthCount);
    for (int k = 0; k < kStrengthCount; ++k) {
      position_criteria(k) =
          position.criterion(strength(position_unit, k), StrengthRules::kLeastNoise * mean);
      radius_criteria(k) = radii.criterion(strength(radius_unit, k));
    }

    // Radii that do not vary say nothing of how much they would.
    const double least = samples.radii.minCoeff();
    if (samples.radii.maxCoeff() <= (1 + StrengthRules::kLeastNoise) * least) {
      radius_criteria.setZero();
    }
  }

  PathLimits limits(const BSplineCurve<1>& log_radius) const {
    return {samples,
            position,
            log_radius,
            options.largest_move,
            options.largest_bend,
            start.hidden_mm,
            position.knots().last() - end.hidden_mm};
  }
  Followed followed(const Eigen::MatrixXd& ends) const {
    const BSplineCurve<1> log_radius = radii.log_radius();
    return follow_rules(limits(log_radius), position_strength, ends);
  }
  State reparametrised(const Eigen::MatrixXd& C) const;

  BranchSmootherOptions options;
  SmootherEnd start;
  SmootherEnd end;
  BranchSamples samples;
  PenalisedSpline position;
  RadiusSpline radii;
  double position_unit = 0;
  double radius_unit = 0;
  Eigen::VectorXd position_criteria;
  Eigen::VectorXd radius_criteria;
  double position_strength = 0;
  double radius_strength = 0;
};

// The same samples at the arc lengths where the curve has them. Where the points turn back, the
// curve is shorter than the way through them: it then runs slowly through the bend, which makes it
// sharper than its stiffness knows.
BranchSmoother::State BranchSmoother::State::reparametrised(const Eigen::MatrixXd& C) const {
  const BSplineCurve<3> curve(position.knots(), C.transpose());
  State again = *this;
  Eigen::VectorXd& t = again.samples.parameters;
  for (Eigen::Index i = 1; i < t.size(); ++i) {
    constexpr int kSteps = 8;
    const double from = samples.parameters(i - 1);
    const double step = (samples.parameters(i) - from) / kSteps;
    double length = 0;
    for (int k = 0; k < kSteps; ++k) length += step * curve.at(from + (k + 0.5) * step, 1).norm();
    // No two samples in one place: that would be a spline without a parameter between them.
    t(i) = t(i - 1) + std::max(length, PathRules::kLeastShare * kSteps * step);
  }

  const KnotVector knots = knots_for(again.samples);
  again.position = PenalisedSpline(knots, t, samples.points, samples.weights);
  again.radii = RadiusSpline(again.samples, knots);
  again.radii.smooth(again.samples, radius_strength);
  return again;
}

BranchSmoother::BranchSmoother(const CenterlineBranch& branch, const SmootherEnd& start,
                               const SmootherEnd& end, double tree_radius_mm,
                               const BranchSmootherOptions& options) {
  EXPECTS(branch.points_mm.cols() >= 2 && branch.radii_mm.minCoeff() > 0);
  state_ = std::make_unique<State>(branch, start, end, tree_radius_mm, options);
}

BranchSmoother::~BranchSmoother() = default;
BranchSmoother::BranchSmoother(BranchSmoother&&) noexcept = default;
BranchSmoother& BranchSmoother::operator=(BranchSmoother&&) noexcept = default;

const Eigen::VectorXd& BranchSmoother::position_criteria() const {
  return state_->position_criteria;
}

const Eigen::VectorXd& BranchSmoother::radius_criteria() const { return state_->radius_criteria; }

void BranchSmoother::choose_strengths(double position_of_tree, double radius_of_tree) {
  State& s = *state_;
  s.position_strength =
      strength(s.position_unit,
               drawn_to(position_of_tree, StrengthRules::kPositionPrior, s.position_criteria));
  s.radius_strength = strength(
      s.radius_unit, drawn_to(radius_of_tree, StrengthRules::kRadiusPrior, s.radius_criteria));
  s.radii.smooth(s.samples, s.radius_strength);
}

CondensedEnds BranchSmoother::condensed_ends() const {
  return state_->position.condensed_ends(state_->position_strength);
}

SmoothPath BranchSmoother::smooth(const Vec3& start, const Vec3& end) const {
  EXPECTS(state_->position_strength > 0);
  Eigen::MatrixXd ends(2, 3);
  ends.row(0) = start.transpose();
  ends.row(1) = end.transpose();

  // A spline that cannot keep its rules may do so in a parameter that is its own arc length.
  Followed best = state_->followed(ends);
  State state = *state_;
  Followed now = best;
  State tried = state;
  for (int k = 0; k < PathRules::kReparametrisations && best.excess > 0; ++k) {
    tried = tried.reparametrised(now.coefficients);
    now = tried.followed(ends);
    if (now.excess >= best.excess) continue;
    best = now;
    state = tried;
  }

  // What is handed on: where the rules are broken still, the radius gives way to the bend.
  const BSplineCurve<1> log_radius = state.radii.log_radius();
  const BSplineCurve<3> curve(state.position.knots(), best.coefficients.transpose());
  DensePath dense = dense_path(curve, state.limits(log_radius));
  const double factor = reduce_radius_in_bends(state.options.largest_bend, dense);
  const BranchSamples& samples = state.samples;
  const Eigen::VectorXd moves =
      (state.position.values_at_samples(best.coefficients) - samples.points)
          .rowwise()
          .norm()
          .cwiseProduct(samples.weights.cwiseSign());
  return SmoothPath{
      compressed(dense, state.options.path_tolerance, state.position.knots().degree()),
      moves.maxCoeff(), moves.cwiseQuotient(samples.radii).maxCoeff(), dense.bends.maxCoeff(),
      factor};
}

}  // namespace angiospline
