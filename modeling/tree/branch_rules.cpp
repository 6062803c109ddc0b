#include "modeling/tree/branch_rules.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Geometry>

#include "base/index.h"
#include "modeling/tree/rules.h"

namespace angiospline {
namespace {

// The sharpest bend of each span, as the rules count it.
Eigen::VectorXd bends_of_spans(const PathLimits& limits, const Eigen::MatrixXd& C) {
  const PenalisedSpline& spline = limits.spline;
  const BSplineCurve<3> curve(spline.knots(), C.transpose());
  Eigen::VectorXd bends = Eigen::VectorXd::Zero(spline.span_count());
  for (int k = 0; k < spline.span_count(); ++k) {
    const double a = spline.breaks()[index(k)];
    const double width = spline.breaks()[index(k) + 1] - a;
    for (int i = 0; i <= EasingRules::kBendSamples; ++i) {
      const double t = a + width * i / EasingRules::kBendSamples;
      const Vec3 d1 = curve.at(t, 1);
      const double radius = std::exp(limits.log_radius.at(t)(0));
      // A curve that nearly stands still is about to turn on the spot, between samples.
      constexpr double kLeast = EasingRules::kLeastSpeed;
      const double stall = kLeast / std::max(d1.norm(), 1e-6 * kLeast);
      const double bend = bend_from(d1, curve.at(t, 2), radius) + (stall > 1 ? stall - 1 : 0.0);
      bends(k) = std::max(bends(k), limits.is_visible(t) ? bend : EasingRules::kHiddenBends * bend);
    }
  }
  return bends;
}

// Minimise misfit plus bending of C subject to samples F = B C that lie in balls around the points
// P (Boyd et al. 2011, section 3.1, scaled form): Q are the samples' places inside their balls, U
// the scaled multipliers, rho their penalty (here one for each sample), W the weights of the
// misfit.
class RuleFollower {
 public:
  RuleFollower(const PathLimits& limits, double strength, const Eigen::MatrixXd& ends)
      : limits_(limits),
        ends_(ends),
        spline_(limits.spline),
        strength_(strength),
        points_(limits.samples.points),
        weights_(limits.samples.weights),
        multipliers_(Eigen::MatrixXd::Zero(points_.rows(), 3)),
        penalties_(Eigen::VectorXd::Zero(points_.rows())),
        stiffness_(Eigen::VectorXd::Ones(spline_.span_count())),
        largest_move_mm_(limits.largest_move * limits.samples.radii) {
    for (Eigen::Index i = 0; i < largest_move_mm_.size(); ++i) {
      largest_move_mm_(i) *= weights_(i) > 0 ? 1.0 : EasingRules::kRoomBetween;
    }
  }

  Followed run() {
    coefficients_ = spline_.solve(strength_, ends_);
    Eigen::VectorXd bends = bends_of_spans(limits_, coefficients_);
    if (judge(bends)) return {best_, 0.0};

    samples_ = spline_.values_at_samples(coefficients_);
    for (int round = 0; round < EasingRules::kRounds; ++round) {
      admm_round();
      bends = bends_of_spans(limits_, coefficients_);
      if (judge(bends)) break;

      // Not there yet, or too stiff a spline for its limits: moves come before bends.
      if (best_excess_ >= EasingRules::kMoveBroken) {
        if (round % EasingRules::kPatience == EasingRules::kPatience - 1) {
          strength_ *= EasingRules::kWeaker;
        }
        continue;
      }
      stiffen(bends);
    }
    return {best_, best_excess_};
  }

 private:
  // Whether both rules hold; remembers the trial that breaks them least, moves first.
  bool judge(const Eigen::VectorXd& bends) {
    const Eigen::VectorXd moves =
        (spline_.values_at_samples(coefficients_) - points_).rowwise().norm();
    const double move_excess =
        std::max(0.0, moves.cwiseQuotient(largest_move_mm_).maxCoeff() - 1.0);
    const double bend_excess = std::max(0.0, bends.maxCoeff() / limits_.largest_bend - 1.0);
    const double excess =
        move_excess > 0 ? EasingRules::kMoveBroken * (1 + move_excess) : bend_excess;
    if (excess < best_excess_) {
      best_ = coefficients_;
      best_excess_ = excess;
    }
    return excess <= 0;
  }

  // The force that moves one sample against the bending of its neighbourhood: penalties of that
  // size converge in few steps whatever the strength. The scaled multipliers follow a penalty that
  // changes (Boyd et al. 2011, section 3.4.1).
  void set_penalties() {
    const double spacing = spline_.knots().last() / static_cast<double>(points_.rows() - 1);
    const double force = strength_ / (spacing * spacing * spacing);
    for (Eigen::Index i = 0; i < points_.rows(); ++i) {
      const int span =
          std::min(spline_.knots().span(limits_.samples.parameters(i)) - spline_.knots().degree(),
                   spline_.span_count() - 1);
      const double now =
          std::clamp(force, EasingRules::kLeastForce, EasingRules::kMostForce) * stiffness_(span);
      if (penalties_(i) > 0) multipliers_.row(i) *= penalties_(i) / now;
      penalties_(i) = now;
    }
    spline_.set_weights(weights_ + penalties_);
    spline_.set_stiffness(stiffness_);
  }

  // Some steps of the method with the stiffness as it is.
  void admm_round() {
    set_penalties();
    const Eigen::MatrixXd& P = points_;
    const Eigen::VectorXd& W = weights_;
    const Eigen::VectorXd& rho = penalties_;
    Eigen::MatrixXd& C = coefficients_;
    Eigen::MatrixXd& F = samples_;
    Eigen::MatrixXd& U = multipliers_;
    for (int step = 0; step < EasingRules::kAlternations; ++step) {
      // Q: F + U projected into the balls, a little inside.
      Eigen::MatrixXd Q = F + U;
      for (Eigen::Index i = 0; i < P.rows(); ++i) {
        const Eigen::RowVector3d off = Q.row(i) - P.row(i);
        const double inside = EasingRules::kInsideLimit * largest_move_mm_(i);
        if (off.norm() > inside) Q.row(i) = P.row(i) + inside / off.norm() * off;
      }

      // C: the spline through the points P with weights W and Q - U with weights rho, which is one
      // through their weighted means.
      const Eigen::MatrixXd target =
          (W + rho).cwiseInverse().asDiagonal() * (W.asDiagonal() * P + rho.asDiagonal() * (Q - U));
      spline_.set_values(target);
      C = spline_.solve(strength_, ends_);
      F = spline_.values_at_samples(C);

      // U: the running sum of what the two disagree by.
      U += F - Q;
    }
  }

  // Spans that bend too sharply, and less so their neighbours.
  void stiffen(const Eigen::VectorXd& bends) {
    const int spans = spline_.span_count();
    for (int k = 0; k < spans; ++k) {
      if (bends(k) <= limits_.largest_bend) continue;
      for (int j = std::max(0, k - 1); j <= std::min(spans - 1, k + 1); ++j) {
        const double factor = j == k ? EasingRules::kStiffer : EasingRules::kStifferBeside;
        stiffness_(j) = std::min(EasingRules::kMostStiffness, stiffness_(j) * factor);
      }
    }
  }

  const PathLimits& limits_;
  const Eigen::MatrixXd& ends_;
  PenalisedSpline spline_;
  double strength_;
  const Eigen::MatrixXd& points_;
  const Eigen::VectorXd& weights_;
  Eigen::MatrixXd coefficients_;
  Eigen::MatrixXd samples_;
  Eigen::MatrixXd multipliers_;
  Eigen::VectorXd penalties_;
  Eigen::VectorXd stiffness_;        // of each span
  Eigen::VectorXd largest_move_mm_;  // of each sample
  Eigen::MatrixXd best_;
  double best_excess_ = std::numeric_limits<double>::infinity();
};

}  // namespace

Followed follow_rules(const PathLimits& limits, double strength, const Eigen::MatrixXd& ends) {
  return RuleFollower(limits, strength, ends).run();
}

double bend_from(const Vec3& d1, const Vec3& d2, double radius) {
  const double speed = d1.norm();
  if (!(speed > 0)) return std::numeric_limits<double>::infinity();
  return d1.cross(d2).norm() / (speed * speed * speed) * radius;
}

}  // namespace angiospline
