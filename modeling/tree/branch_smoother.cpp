#include "modeling/tree/branch_smoother.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Geometry>

#include "base/contract.h"
#include "kernel/fit/penalised_spline.h"

namespace angiospline {
namespace {

constexpr int kDegree = 5;
constexpr int kFewestSamples = 5;  // sparser branches get points between their points
constexpr double kGapRadii =
    1.5;  // points farther apart get points between them that only keep limits
constexpr double kRoomBetween = 2.0;      // these may move so much farther than the given ones
constexpr Eigen::Index kMostBetween = 8;  // of these, for each point
constexpr double kSpanRadii = 0.5;        // knots of the smoothing spline need not lie closer
constexpr int kMostSpans = 20000;         // of one branch
constexpr double kLeastNoise = 1e-3;      // in mean radii: far below any voxel, above rounding
// Decades by which a branch's strength differs from its tree's: noise is much the same everywhere,
// how radii change is not.
constexpr double kPositionPrior = 0.5;
constexpr double kRadiusPrior = 1.0;

// No radius changes by more than this part of itself plus half its difference to its neighbours.
constexpr double kRadiusChange = 0.1;
// And between two of them no curve leaves what lies between by more than this and half their
// difference.
constexpr double kRadiusSwing = 0.2;
constexpr int kFinerSpans = 4;     // for each sample, where radii jump
constexpr int kRadiusTrials = 24;  // of ever weaker smoothing

constexpr int kRounds = 30;            // of stiffening sharp bends
constexpr int kAlternations = 12;      // between spline and largest move, in each round
constexpr double kInsideLimit = 0.95;  // of the largest move: what alternation leaves over is less
constexpr double kHiddenBends = 0.75;  // what a bend inside a junction counts
constexpr double kMoveBroken = 1e9;    // what a broken move limit counts against bends
constexpr double kLeastSpeed = 0.5;    // of the spline in its parameter, a length of chords
constexpr int kReparametrisations = 5;
constexpr int kPatience = 3;         // rounds before a strength gives in to the largest move
constexpr double kLeastShare = 0.1;  // of its old way that a sample keeps to the one before it
constexpr double kMostStiffness = 1e4;
constexpr double kMostForce = 1e4;
constexpr int kDenseSamples = 12;     // of the final path, for each span of the smoothing spline
constexpr int kRefinements = 12;      // halvings of the final path's spans
constexpr int kBendSamples = 8;       // of curvature, for each span
constexpr double kLeastFactor = 0.2;  // radii are not reduced below this part of themselves

struct Samples {
  Eigen::MatrixXd points;  // one row a sample
  Eigen::VectorXd radii;
  Eigen::VectorXd parameters;
  Eigen::VectorXd weights;
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

// The branch's points, and points between them that only the largest move knows (weight 0): a curve
// between far points must not leave the line that joins them either. A branch of very few points
// gets points with weight, for a spline to stand on.
Samples samples_of(const CenterlineBranch& branch, bool start_is_junction, bool end_is_junction) {
  const Eigen::Index given = branch.points_mm.cols();
  std::vector<Eigen::Index> parts(static_cast<std::size_t>(given - 1), 1);
  Eigen::Index count = given;
  const Eigen::Index fewest =
      given >= kFewestSamples ? 1 : (kFewestSamples + given - 3) / (given - 1);
  Eigen::Index room = kMostBetween * given;
  for (Eigen::Index i = 0; i + 1 < given; ++i) {
    const double length = (branch.points_mm.col(i + 1) - branch.points_mm.col(i)).norm();
    const double radius = 0.5 * (branch.radii_mm(i) + branch.radii_mm(i + 1));
    const double wanted = std::ceil(length / (kGapRadii * radius));
    const auto more = static_cast<Eigen::Index>(std::min(wanted - 1, static_cast<double>(room)));
    parts[static_cast<std::size_t>(i)] = std::max(fewest, 1 + std::max<Eigen::Index>(0, more));
    room -= std::max<Eigen::Index>(0, more);
    count += parts[static_cast<std::size_t>(i)] - 1;
  }
  Samples s;
  s.points.resize(count, 3);
  s.radii.resize(count);
  s.parameters.resize(count);
  s.weights = Eigen::VectorXd::Zero(count);
  Eigen::Index filled = 0;
  const auto add = [&](Eigen::Index i, double t, double weight) {
    const Eigen::Index j = std::min(i + 1, given - 1);
    s.points.row(filled) =
        ((1 - t) * branch.points_mm.col(i) + t * branch.points_mm.col(j)).transpose();
    s.radii(filled) = (1 - t) * branch.radii_mm(i) + t * branch.radii_mm(j);
    s.weights(filled) = weight;
    s.parameters(filled) =
        filled == 0
            ? 0.0
            : s.parameters(filled - 1) + (s.points.row(filled) - s.points.row(filled - 1)).norm();
    ++filled;
  };
  for (Eigen::Index i = 0; i + 1 < given; ++i) {
    const Eigen::Index n = parts[static_cast<std::size_t>(i)];
    for (Eigen::Index k = 0; k < n; ++k) {
      add(i, static_cast<double>(k) / static_cast<double>(n), k == 0 || fewest > 1 ? 1.0 : 0.0);
    }
  }
  add(given - 1, 0.0, 1.0);
  s.radius_weights = s.weights;
  const auto& r = branch.radii_mm;
  if (given == 3) {  // the middle one decides
    if (start_is_junction && jumps(r(0), r(1), r(1))) s.radius_weights(0) = 0;
    if (end_is_junction && jumps(r(2), r(1), r(1))) s.radius_weights(count - 1) = 0;
  }
  if (given > 3) {
    if (start_is_junction && jumps(r(0), r(1), r(2))) s.radius_weights(0) = 0;
    if (end_is_junction && jumps(r(given - 1), r(given - 2), r(given - 3))) {
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

double bend_of(const Vec3& d1, const Vec3& d2, double radius) {
  const double speed = d1.norm();
  if (!(speed > 0)) return std::numeric_limits<double>::infinity();
  return d1.cross(d2).norm() / (speed * speed * speed) * radius;
}

// A quadratic through the least value and its neighbours.
double parabola_vertex(const Eigen::VectorXd& v, Eigen::Index k) {
  if (k == 0 || k + 1 >= v.size()) return static_cast<double>(k);
  const double below = v(k - 1) - v(k);
  const double above = v(k + 1) - v(k);
  if (!(below + above > 0) || !std::isfinite(below + above)) return static_cast<double>(k);
  return static_cast<double>(k) + 0.5 * (below - above) / (below + above);
}

// The dense curve and its radius, sampled for the final path.
struct DensePath {
  Eigen::VectorXd s;       // arc length
  Eigen::MatrixXd values;  // x, y, z, radius
  Eigen::VectorXd bends;   // curvature times radius
};

}  // namespace

double best_grid_position(const Eigen::VectorXd& criteria) {
  Eigen::Index least = 0;
  criteria.minCoeff(&least);
  return parabola_vertex(criteria, least);
}

// A path's coefficients and by how much it breaks the rules: 0 if it keeps them.
struct Followed {
  Eigen::MatrixXd coefficients;
  double excess = 0.0;
};

struct BranchSmoother::State {
  State(const CenterlineBranch& branch, const SmootherEnd& start_end, const SmootherEnd& end_end,
        double tree_radius, const BranchSmootherOptions& opts)
      : options(opts),
        start(start_end),
        end(end_end),
        samples(samples_of(branch, start.is_junction, end.is_junction)),
        knots(KnotVector::clamped(
            kDegree,
            uniform(samples.parameters(samples.parameters.size() - 1), span_count(samples)))),
        position(knots, samples.parameters, samples.points, samples.weights),
        radius_knots(knots),
        log_radius(radius_knots, samples.parameters, samples.radii.array().log().matrix(),
                   samples.radius_weights) {
    const double mean = samples.radii.mean();
    // Noise of a given size in the tree against curvatures of the order of one over the radius,
    // that stay alike over a radius; and relative noise of the radii against changes over a radius.
    position_unit = tree_radius * tree_radius * mean;
    radius_unit = mean * mean * mean;
    position_criteria.resize(kStrengthCount);
    radius_criteria.resize(kStrengthCount);
    for (int k = 0; k < kStrengthCount; ++k) {
      position_criteria(k) = position.criterion(strength(position_unit, k), kLeastNoise * mean);
      radius_criteria(k) = log_radius.criterion(strength(radius_unit, k), kLeastNoise);
    }
    // Radii that do not vary say nothing of how much they would.
    if (samples.radii.maxCoeff() <= (1 + kLeastNoise) * samples.radii.minCoeff()) {
      radius_criteria.setZero();
    }
  }

  static double strength(double unit, double grid_position) {
    return unit * std::pow(10.0, kFirstStrength + kStrengthStep * grid_position);
  }

  // The branch's verdict with a Gaussian prior around the tree's.
  static double drawn_to(double of_tree, double width, Eigen::VectorXd criteria) {
    for (Eigen::Index k = 0; k < criteria.size(); ++k) {
      const double off = (static_cast<double>(k) - of_tree) * kStrengthStep / width;
      criteria(k) += off * off;
    }
    return best_grid_position(criteria);
  }

  // By how much a smoothed radius breaks its rules, 1 if it just keeps them: no sample changes too
  // much, and between two samples nothing swings out of what lies between them.
  double broken_by(const Eigen::MatrixXd& C) const {
    const Eigen::VectorXd y = samples.radii.array().log();
    const Eigen::VectorXd change = (log_radius.values_at_samples(C).col(0) - y).cwiseAbs();
    const BSplineCurve<1> log_r(radius_knots, C.transpose());
    const Eigen::Index last = y.size() - 1;
    double worst = 0;
    for (Eigen::Index i = 0; i <= last; ++i) {
      const double before = i > 0 ? std::abs(y(i) - y(i - 1)) : 0.0;
      const double after = i < last ? std::abs(y(i) - y(i + 1)) : 0.0;
      if (samples.radius_weights(i) > 0) {
        worst = std::max(worst, change(i) / (kRadiusChange + 0.5 * std::max(before, after)));
      }
      if (i == last || samples.radius_weights(i) == 0 || samples.radius_weights(i + 1) == 0) {
        continue;
      }
      const double allowed = kRadiusSwing + 0.5 * after;
      for (const double f : {0.25, 0.5, 0.75}) {
        const double t = (1 - f) * samples.parameters(i) + f * samples.parameters(i + 1);
        const double value = log_r.at(t)(0);
        const double out =
            std::max(value - std::max(y(i), y(i + 1)), std::min(y(i), y(i + 1)) - value);
        worst = std::max(worst, out / allowed);
      }
    }
    return worst;
  }

  // Weakens the smoothing of the radii until the rules are kept; where radii jump too far for that
  // the strength is taken that breaks them least.
  Eigen::MatrixXd smooth_log_radius(double strength, double& least) const {
    Eigen::MatrixXd best;
    least = std::numeric_limits<double>::infinity();
    for (int trial = 0; trial < kRadiusTrials; ++trial, strength *= 0.5) {
      Eigen::MatrixXd C = log_radius.solve(strength);
      const double broken = broken_by(C);
      if (broken < least || best.size() == 0) {
        least = broken;
        best = std::move(C);
      }
      if (least <= 1) break;
    }
    return best;
  }

  // Radii that jump get spans as fine as their samples: the path's own are half a mean radius long,
  // and a curve that cannot follow a jump swings on both sides of it.
  void fit_radii() {
    double broken = 0;
    log_radius_coefficients = smooth_log_radius(radius_strength, broken);
    if (broken <= 1) return;
    const double spacing = (samples.parameters.tail(samples.parameters.size() - 1) -
                            samples.parameters.head(samples.parameters.size() - 1))
                               .minCoeff();
    const int spans = std::clamp(static_cast<int>(knots.last() / spacing), position.span_count(),
                                 static_cast<int>(kFinerSpans * samples.parameters.size()));
    State finer = *this;
    finer.radius_knots = KnotVector::clamped(kDegree, uniform(knots.last(), spans));
    finer.log_radius =
        PenalisedSpline(finer.radius_knots, samples.parameters,
                        samples.radii.array().log().matrix(), samples.radius_weights);
    double finer_broken = 0;
    Eigen::MatrixXd C = finer.smooth_log_radius(radius_strength, finer_broken);
    if (finer_broken >= broken) return;
    radius_knots = std::move(finer.radius_knots);
    log_radius = std::move(finer.log_radius);
    log_radius_coefficients = std::move(C);
  }

  bool is_visible(double t) const {
    return t >= start.hidden_mm && t <= knots.last() - end.hidden_mm;
  }

  DensePath dense(const Eigen::MatrixXd& C) const;
  double reduce_radius_in_bends(DensePath& path) const;
  BSplineCurve<4> compressed(const DensePath& path) const;
  Eigen::VectorXd bends_of_spans(const Eigen::MatrixXd& C) const;
  Followed follow_rules(const Eigen::MatrixXd& ends) const;
  State reparametrised(const Eigen::MatrixXd& C) const;

  BranchSmootherOptions options;
  SmootherEnd start;
  SmootherEnd end;
  Samples samples;
  KnotVector knots;
  PenalisedSpline position;
  KnotVector radius_knots;
  PenalisedSpline log_radius;
  double position_unit = 0;
  double radius_unit = 0;
  Eigen::VectorXd position_criteria;
  Eigen::VectorXd radius_criteria;
  double position_strength = 0;
  double radius_strength = 0;
  Eigen::MatrixXd log_radius_coefficients;
};

DensePath BranchSmoother::State::dense(const Eigen::MatrixXd& C) const {
  const BSplineCurve<3> curve(knots, C.transpose());
  const BSplineCurve<1> log_r(radius_knots, log_radius_coefficients.transpose());
  const int count = std::max(kDenseSamples * position.span_count(), 128);
  const double step = knots.last() / count;
  DensePath path{Eigen::VectorXd::Zero(count + 1), Eigen::MatrixXd(count + 1, 4),
                 Eigen::VectorXd::Zero(count + 1)};
  constexpr std::array<double, 3> kAt = {0.1127016653792583, 0.5, 0.8872983346207417};
  constexpr std::array<double, 3> kWeight = {5.0 / 18, 8.0 / 18, 5.0 / 18};
  for (int k = 0; k <= count; ++k) {
    const double t = k == count ? knots.last() : step * k;
    double speed = 0;
    for (std::size_t g = 0; k > 0 && g < kAt.size(); ++g) {
      speed += kWeight[g] * curve.at(t - step * (1 - kAt[g]), 1).norm();
    }
    if (k > 0) path.s(k) = path.s(k - 1) + step * speed;
    path.values.row(k).head<3>() = curve.at(t).transpose();
    path.values(k, 3) = std::exp(log_r.at(t)(0));
    if (is_visible(t)) path.bends(k) = bend_of(curve.at(t, 1), curve.at(t, 2), path.values(k, 3));
  }
  return path;
}

// Where a bend is still too sharp for the radius, the radius gives way, over two radii to either
// side.
double BranchSmoother::State::reduce_radius_in_bends(DensePath& path) const {
  const Eigen::Index count = path.s.size();
  Eigen::VectorXd factor = Eigen::VectorXd::Ones(count);
  for (Eigen::Index k = 0; k < count; ++k) {
    if (path.bends(k) <= options.largest_bend) continue;
    const double least = std::max(kLeastFactor, options.largest_bend / path.bends(k));
    const double reach = 2 * path.values(k, 3);
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

// The path with few spans: those on which it misses the tolerance are halved.
BSplineCurve<4> BranchSmoother::State::compressed(const DensePath& dense) const {
  const Eigen::Index last = dense.s.size() - 1;
  const double length = dense.s(last);
  Eigen::MatrixXd ends(2, 4);
  ends.row(0) = dense.values.row(0);
  ends.row(1) = dense.values.row(last);
  std::vector<double> breaks = uniform(length, 2);
  for (int round = 0;; ++round) {
    const KnotVector knots_now = KnotVector::clamped(kDegree, breaks);
    const PenalisedSpline fit(knots_now, dense.s, dense.values, Eigen::VectorXd::Ones(last + 1));
    // Keeps the system definite without smoothing: far below the data, at the scale of the spans.
    const double strength = 1e-9 * std::pow(length / static_cast<double>(breaks.size() - 1), 3);
    const Eigen::MatrixXd C = fit.solve(strength, ends);
    const Eigen::MatrixXd off = fit.values_at_samples(C) - dense.values;
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
      // A half must keep enough samples to stand on.
      const bool can_halve = k - first >= 2 * kDegree;
      if (worst > options.path_tolerance && can_halve) {
        finer.push_back(0.5 * (breaks[b] + breaks[b + 1]));
      }
    }
    finer.push_back(length);
    if (finer.size() == breaks.size() || round == kRefinements) {
      return BSplineCurve<4>(knots_now, C.transpose());
    }
    breaks = std::move(finer);
  }
}

Eigen::VectorXd BranchSmoother::State::bends_of_spans(const Eigen::MatrixXd& C) const {
  const BSplineCurve<3> curve(knots, C.transpose());
  const BSplineCurve<1> log_r(radius_knots, log_radius_coefficients.transpose());
  Eigen::VectorXd bends = Eigen::VectorXd::Zero(position.span_count());
  for (int k = 0; k < position.span_count(); ++k) {
    const double a = position.breaks()[static_cast<std::size_t>(k)];
    const double width = position.breaks()[static_cast<std::size_t>(k) + 1] - a;
    for (int i = 0; i <= kBendSamples; ++i) {
      const double t = a + width * i / kBendSamples;
      const Vec3 d1 = curve.at(t, 1);
      // A curve that nearly stands still is about to turn on the spot, between samples.
      const double stall = kLeastSpeed / std::max(d1.norm(), 1e-6 * kLeastSpeed);
      const double bend =
          bend_of(d1, curve.at(t, 2), std::exp(log_r.at(t)(0))) + (stall > 1 ? stall - 1 : 0.0);
      bends(k) = std::max(bends(k), is_visible(t) ? bend : kHiddenBends * bend);
    }
  }
  return bends;
}

// The spline whose samples keep the largest move, stiffened span by span where it bends too
// sharply. For a given stiffness it is the minimiser of misfit plus bending over all curves that
// keep the largest move, found by the alternating direction method of multipliers: Q are the
// samples' places inside their balls, U the scaled multipliers (Boyd et al. 2011, Found. Trends
// Mach. Learn. 3).
Followed BranchSmoother::State::follow_rules(const Eigen::MatrixXd& ends) const {
  PenalisedSpline spline = position;
  const Eigen::MatrixXd& P = samples.points;
  const Eigen::VectorXd& W = samples.weights;
  Eigen::VectorXd limit = options.largest_move * samples.radii;
  for (Eigen::Index i = 0; i < limit.size(); ++i) limit(i) *= W(i) > 0 ? 1.0 : kRoomBetween;
  Eigen::VectorXd stiffness = Eigen::VectorXd::Ones(spline.span_count());
  Eigen::MatrixXd C = spline.solve(position_strength, ends);
  Eigen::MatrixXd best;
  double best_excess = std::numeric_limits<double>::infinity();
  // Returns whether both rules hold; remembers the trial that breaks them least, moves first.
  const auto judge = [&](const Eigen::VectorXd& bends) {
    const Eigen::VectorXd moves = (spline.values_at_samples(C) - P).rowwise().norm();
    const double move_excess = std::max(0.0, moves.cwiseQuotient(limit).maxCoeff() - 1.0);
    const double bend_excess = std::max(0.0, bends.maxCoeff() / options.largest_bend - 1.0);
    const double excess = move_excess > 0 ? kMoveBroken * (1 + move_excess) : bend_excess;
    if (excess < best_excess) {
      best = C;
      best_excess = excess;
    }
    return excess <= 0;
  };
  Eigen::VectorXd bends = bends_of_spans(C);
  if (judge(bends)) return {best, 0.0};
  Eigen::MatrixXd F = spline.values_at_samples(C);
  Eigen::MatrixXd U = Eigen::MatrixXd::Zero(P.rows(), 3);
  Eigen::VectorXd rho = Eigen::VectorXd::Zero(P.rows());
  const double spacing = knots.last() / static_cast<double>(P.rows() - 1);
  double strength = position_strength;
  for (int round = 0; round < kRounds; ++round) {
    // The force that moves one sample against the bending of its neighbourhood: multipliers of that
    // size converge in few steps whatever the strength.
    const double force = strength / (spacing * spacing * spacing);
    for (Eigen::Index i = 0; i < P.rows(); ++i) {
      const int span =
          std::min(knots.span(samples.parameters(i)) - kDegree, spline.span_count() - 1);
      const double now = std::clamp(force, 4.0, kMostForce) * stiffness(span);
      if (rho(i) > 0) U.row(i) *= rho(i) / now;
      rho(i) = now;
    }
    spline.set_weights(W + rho);
    spline.set_stiffness(stiffness);
    for (int step = 0; step < kAlternations; ++step) {
      Eigen::MatrixXd Q = F + U;
      for (Eigen::Index i = 0; i < P.rows(); ++i) {
        const Eigen::RowVector3d off = Q.row(i) - P.row(i);
        const double inside = kInsideLimit * limit(i);
        if (off.norm() > inside) Q.row(i) = P.row(i) + inside / off.norm() * off;
      }
      const Eigen::MatrixXd target =
          (W + rho).cwiseInverse().asDiagonal() * (W.asDiagonal() * P + rho.asDiagonal() * (Q - U));
      spline.set_values(target);
      C = spline.solve(strength, ends);
      F = spline.values_at_samples(C);
      U += F - Q;
    }
    bends = bends_of_spans(C);
    if (judge(bends)) break;
    if (best_excess >= kMoveBroken) {  // not there yet, or too stiff a spline for its limits
      if (round % kPatience == kPatience - 1) strength *= 0.25;
      continue;
    }
    for (int k = 0; k < spline.span_count(); ++k) {
      if (bends(k) <= options.largest_bend) continue;
      for (int j = std::max(0, k - 1); j <= std::min(spline.span_count() - 1, k + 1); ++j) {
        stiffness(j) = std::min(kMostStiffness, stiffness(j) * (j == k ? 1.6 : 1.25));
      }
    }
  }
  return {best, best_excess};
}

// The same samples at the arc lengths where the curve has them. Where the points turn back, the
// curve is shorter than the way through them: it then runs slowly through the bend, which makes it
// sharper than its stiffness knows.
BranchSmoother::State BranchSmoother::State::reparametrised(const Eigen::MatrixXd& C) const {
  const BSplineCurve<3> curve(knots, C.transpose());
  State again = *this;
  Eigen::VectorXd& t = again.samples.parameters;
  for (Eigen::Index i = 1; i < t.size(); ++i) {
    constexpr int kSteps = 8;
    const double from = samples.parameters(i - 1);
    const double step = (samples.parameters(i) - from) / kSteps;
    double length = 0;
    for (int k = 0; k < kSteps; ++k) length += step * curve.at(from + (k + 0.5) * step, 1).norm();
    // No two samples in one place: that would be a spline without a parameter between them.
    t(i) = t(i - 1) + std::max(length, kLeastShare * kSteps * step);
  }
  again.knots = KnotVector::clamped(kDegree, uniform(t(t.size() - 1), span_count(again.samples)));
  again.position = PenalisedSpline(again.knots, t, samples.points, samples.weights);
  again.radius_knots = again.knots;
  again.log_radius =
      PenalisedSpline(again.knots, t, samples.radii.array().log().matrix(), samples.radius_weights);
  again.fit_radii();
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
  s.position_strength = State::strength(
      s.position_unit, State::drawn_to(position_of_tree, kPositionPrior, s.position_criteria));
  s.radius_strength = State::strength(
      s.radius_unit, State::drawn_to(radius_of_tree, kRadiusPrior, s.radius_criteria));
  s.fit_radii();
}

CondensedEnds BranchSmoother::condensed_ends() const {
  return state_->position.condensed_ends(state_->position_strength);
}

SmoothPath BranchSmoother::smooth(const Vec3& start, const Vec3& end) const {
  EXPECTS(state_->position_strength > 0);
  Eigen::MatrixXd ends(2, 3);
  ends.row(0) = start.transpose();
  ends.row(1) = end.transpose();
  Followed best = state_->follow_rules(ends);
  State state = *state_;
  Followed now = best;
  State tried = state;
  for (int k = 0; k < kReparametrisations && best.excess > 0; ++k) {
    tried = tried.reparametrised(now.coefficients);
    now = tried.follow_rules(ends);
    if (now.excess >= best.excess) continue;
    best = now;
    state = tried;
  }
  DensePath dense = state.dense(best.coefficients);
  const double factor = state.reduce_radius_in_bends(dense);
  const Samples& samples = state.samples;
  const Eigen::VectorXd moves =
      (state.position.values_at_samples(best.coefficients) - samples.points)
          .rowwise()
          .norm()
          .cwiseProduct(samples.weights.cwiseSign());
  return SmoothPath{state.compressed(dense), moves.maxCoeff(),
                    moves.cwiseQuotient(samples.radii).maxCoeff(), dense.bends.maxCoeff(), factor};
}

}  // namespace angiospline
