#include "modeling/layout/opening_arcs.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Dense>

#include "base/contract.h"
#include "modeling/layout/rules.h"

namespace angiospline {
namespace {

using namespace layout_rules;

using BernsteinRow = Eigen::Matrix<double, 6, 1>;

BernsteinRow bernstein(double t) {
  const double s = 1 - t;
  BernsteinRow b;
  b << s * s * s * s * s, 5 * s * s * s * s * t, 10 * s * s * s * t * t, 10 * s * s * t * t * t,
      5 * s * t * t * t * t, t * t * t * t * t;
  return b;
}

Eigen::Vector2d direction(double angle) { return {std::cos(angle), std::sin(angle)}; }
Eigen::Vector2d tangent(double angle) { return {-std::sin(angle), std::cos(angle)}; }

// The arc from angle 0 to `angle` with end derivatives of these lengths; the two inner points start
// from the circle's curvature and are fitted to it by Gauss-Newton steps. With `free_speed` both
// lengths are one more unknown.
QuinticArc fit_arc(double angle, double speed_start, double speed_end, bool free_speed) {
  QuinticArc c;
  const auto set_ends = [&] {
    c.col(0) = direction(0);
    c.col(5) = direction(angle);
    c.col(1) = c.col(0) + speed_start / 5 * tangent(0);
    c.col(4) = c.col(5) - speed_end / 5 * tangent(angle);
  };
  set_ends();

  // Second differences from the circle's curvature: a quintic's c'' is 20 times those.
  c.col(2) = 2 * c.col(1) - c.col(0) - speed_start * speed_start / 20 * direction(0);
  c.col(3) = 2 * c.col(4) - c.col(5) - speed_end * speed_end / 20 * direction(angle);

  const int unknowns = free_speed ? 5 : 4;

  // Gauss-Newton on (|p|^2 - 1) / 2, whose derivative by p is p.
  for (int step = 0; step < kArcSteps; ++step) {
    Eigen::MatrixXd J(kArcSamples + unknowns, unknowns);
    Eigen::VectorXd residual(kArcSamples + unknowns);
    for (int k = 0; k < kArcSamples; ++k) {
      const BernsteinRow b = bernstein((k + 0.5) / kArcSamples);
      const Eigen::Vector2d p = c * b;
      residual(k) = (p.squaredNorm() - 1) / 2;
      J.row(k).head<4>() << b(2) * p.x(), b(2) * p.y(), b(3) * p.x(), b(3) * p.y();
      if (free_speed) J(k, 4) = p.dot(b(1) * tangent(0) - b(4) * tangent(angle)) / 5;
    }
    // Sliding along the circle is nearly free: a little damping keeps the step short.
    J.bottomRows(unknowns) = kArcDamping * Eigen::MatrixXd::Identity(unknowns, unknowns);
    residual.tail(unknowns).setZero();

    const Eigen::VectorXd move = -J.householderQr().solve(residual);
    c.col(2) += move.head<2>();
    c.col(3) += move.segment<2>(2);
    if (free_speed) {
      speed_start += move(4);
      speed_end += move(4);
      set_ends();
    }
    if (move.norm() < 1e-12) break;
  }
  return c;
}

double best_speed(double angle) {
  const QuinticArc arc = fit_arc(angle, angle, angle, true);
  return 5 * (arc.col(1) - arc.col(0)).norm();
}

}  // namespace

std::vector<QuinticArc> opening_arcs(const std::vector<double>& seams) {
  EXPECTS(seams.size() >= 2);
  const std::size_t count = seams.size();
  std::vector<double> angle(count);
  std::vector<double> speed(count);
  for (std::size_t k = 0; k < count; ++k) {
    angle[k] = k + 1 < count ? seams[k + 1] - seams[k] : seams[0] + 2 * std::numbers::pi - seams[k];
    EXPECTS(angle[k] > 0);
    speed[k] = best_speed(angle[k]);
  }

  // Neighbours agree on the derivative at their seam: the mean of what either would choose.
  std::vector<QuinticArc> arcs;
  for (std::size_t k = 0; k < count; ++k) {
    const double start = (speed[(k + count - 1) % count] + speed[k]) / 2;
    const double end = (speed[k] + speed[(k + 1) % count]) / 2;
    const QuinticArc arc = fit_arc(angle[k], start, end, false);
    Eigen::Matrix2d turn;
    turn << direction(seams[k]), tangent(seams[k]);
    arcs.push_back(turn * arc);
    // Shared to the last bit: neighbours own one seam point.
    arcs.back().col(0) = direction(seams[k]);
    arcs.back().col(5) = direction(seams[(k + 1) % count]);
  }
  return arcs;
}

double largest_radial_error(const QuinticArc& arc) {
  double worst = 0;
  for (int k = 0; k <= 64; ++k) {
    worst = std::max(worst, std::abs((arc * bernstein(k / 64.0)).norm() - 1));
  }
  return worst;
}

}  // namespace angiospline
