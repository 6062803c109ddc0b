#include "modeling/body/path_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include <Eigen/Geometry>

#include "base/contract.h"
#include "base/index.h"
#include "modeling/body/lead_in.h"
#include "modeling/body/rules.h"

namespace angiospline {
namespace {

constexpr int kDegree = 5;

// Parameters by arc length.
Rail rail_through(Eigen::Matrix4Xd points) {
  Rail rail;
  double along = 0;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    if (i > 0) along += (points.col(i) - points.col(i - 1)).head<3>().norm();
    rail.parameters.push_back(along);
  }
  EXPECTS(along > 0);
  for (double& t : rail.parameters) t = std::min(1.0, t / along);
  rail.length_mm = along;
  rail.mean_radius_mm = points.row(3).mean();
  rail.points = std::move(points);
  return rail;
}

// Even samples of the rail: every span of the spline sees the same number of them.
void resample(Rail& rail, int count) {
  Eigen::Matrix4Xd points(4, count + 1);
  std::vector<double> parameters;
  std::size_t k = 0;
  for (int i = 0; i <= count; ++i) {
    const double t = static_cast<double>(i) / count;
    while (k + 2 < rail.parameters.size() && rail.parameters[k + 1] < t) ++k;
    const double width = rail.parameters[k + 1] - rail.parameters[k];
    const double f = width > 0 ? std::clamp((t - rail.parameters[k]) / width, 0.0, 1.0) : 0.0;
    const auto column = static_cast<Eigen::Index>(k);
    points.col(i) = (1 - f) * rail.points.col(column) + f * rail.points.col(column + 1);
    parameters.push_back(t);
  }

  rail.points = std::move(points);
  rail.parameters = std::move(parameters);
}

// The rail from where one lead-in joins it to where the other leaves it, with their samples.
Rail led_in(const Rail& rail, const std::optional<LeadIn>& first,
            const std::optional<LeadIn>& last) {
  const double from = first ? first->joins_at : 0;
  const double to = last ? 1 - last->joins_at : 1;

  std::vector<Vec4> points;
  if (first) {
    for (const auto& p : first->samples.colwise()) points.emplace_back(p);
  }
  for (std::size_t i = 0; i < rail.parameters.size(); ++i) {
    const double t = rail.parameters[i];
    if (t >= from && t <= to) points.emplace_back(rail.points.col(static_cast<Eigen::Index>(i)));
  }
  if (last) {
    for (Eigen::Index i = last->samples.cols(); i-- > 0;) {
      points.emplace_back(last->samples.col(i));
    }
  }
  return rail_through(Eigen::Map<Eigen::Matrix4Xd>(points.front().data(), 4,
                                                   static_cast<Eigen::Index>(points.size())));
}

// Held control points: the end itself, and with a direction the next one along it.
Eigen::MatrixXd held_points(const PathEnd& end, double step) {
  Eigen::RowVector4d row;
  row << end.point_mm.transpose(), end.radius_mm;
  if (end.direction.isZero()) return row;
  Eigen::MatrixXd rows(2, 4);
  rows.row(0) = row;
  rows.row(1) = row;
  rows.row(1).head<3>() += step * end.direction.transpose();
  return rows;
}

// Stiffness per radius in the units of the parameter, in which a radius is `stretch` long.
std::vector<double> scaled(const std::vector<double>& stiffness, double stretch, double least) {
  std::vector<double> bending;
  for (const double s : stiffness) {
    bending.push_back(std::max(s, least) * stretch * stretch * stretch);
  }
  return bending;
}

// The first and one past the last of a span's neighbourhood among `count`.
std::pair<std::size_t, std::size_t> beside(std::size_t span, std::size_t count) {
  constexpr std::size_t kReach = PathFitRules::kBesideSpans;
  return {span >= kReach ? span - kReach : 0, std::min(span + kReach + 1, count)};
}

}  // namespace

Rail make_rail(const Eigen::Matrix4Xd& target, const PathEnd& start, const PathEnd& end) {
  Eigen::Matrix4Xd points(4, target.cols() + 2);
  points.col(0) << start.point_mm, start.radius_mm;
  points.middleCols(1, target.cols()) = target;
  points.rightCols<1>() << end.point_mm, end.radius_mm;
  return rail_through(std::move(points));
}

Bend bend_at(const BSplineCurve<4>& curve, double t) {
  const Vec4 value = curve.at(t);
  const Vec3 d1 = curve.at(t, 1).head<3>();
  const Vec3 d2 = curve.at(t, 2).head<3>();
  const double speed = d1.norm();
  const double curvature = speed > 0 ? d1.cross(d2).norm() / (speed * speed * speed)
                                     : std::numeric_limits<double>::infinity();
  return {t, curvature, value(3)};
}

std::vector<Bend> bends_of(const BSplineCurve<4>& curve, int count) {
  std::vector<Bend> bends;
  for (int i = 0; i <= count; ++i) bends.push_back(bend_at(curve, static_cast<double>(i) / count));
  return bends;
}

double tightest(const std::vector<Bend>& bends) {
  double largest = 0;
  for (const Bend& bend : bends) largest = std::max(largest, bend.tightness());
  return largest;
}

PathFit::PathFit(Rail rail, const PathEnd& start, const PathEnd& end, double largest_move)
    : rail_(rail),
      target_(std::move(rail)),
      start_(start),
      end_(end),
      largest_move_(largest_move),
      knots_(make_knots()),
      course_(knots_, Eigen::Matrix4Xd::Zero(4, knots_.control_point_count())) {
  prepare();
}

void PathFit::prepare() {
  const std::size_t spans = knots_.breakpoints().size() - 1;
  stiffness_.assign(spans, PathFitRules::kSlack);
  resample(rail_, 4 * static_cast<int>(spans) + 4);
  course_ = solve();
}

void PathFit::lead_in() {
  const double near = PathFitRules::kNearEnd * rail_.mean_radius_mm / rail_.length_mm;
  const bool at_first = !start_.direction.isZero() && tightest_within(0, near) > kTightestBend;
  const bool at_last = !end_.direction.isZero() && tightest_within(1 - near, 1) > kTightestBend;
  if (!at_first && !at_last) return;

  const double most = at_first && at_last ? PathFitRules::kMostOfBoth : PathFitRules::kMostOfOne;
  const BSplineCurve<4> course = target_spline();
  std::optional<LeadIn> first, last;
  if (at_first) first = find_lead_in(course, false, start_, PathFitRules::kLeadBend, most);
  if (at_last) last = find_lead_in(course, true, end_, PathFitRules::kLeadBend, most);

  // What is led in is a target like any other: it has a length and knots of its own.
  rail_ = led_in(rail_, first, last);
  knots_ = make_knots();
  prepare();
}

BSplineCurve<4> PathFit::solve() const {
  // The target as a spline: its own bends are not to be straightened by what follows.
  const Eigen::MatrixXd target = target_spline().control_points().transpose();

  // The correction, a stiff beam that starts from what the target misses at the ends.
  const double reach = (knots_[kDegree + 1] - knots_[kDegree]) / kDegree * rail_.length_mm;
  const Eigen::MatrixXd first = held_points(start_, reach);
  const Eigen::MatrixXd last = held_points(end_, -reach).colwise().reverse();
  SplineFitProblem problem = target_problem();
  const double stretch = rail_.radius_in_parameter();
  problem.values.setZero();
  problem.bending = scaled(stiffness_, stretch, PathFitRules::kStiff);
  problem.first = first - target.topRows(first.rows());
  problem.last = last - target.bottomRows(last.rows());
  Eigen::MatrixXd correction = fit_spline(knots_, problem);

  // That of the radius is slack: no bend smears it.
  problem.bending = scaled(slack(), stretch, PathFitRules::kSlackRadius);
  correction.col(3) = fit_spline(knots_, problem).col(3);
  return BSplineCurve<4>(knots_, (target + correction).transpose());
}

bool PathFit::stiffen(const BSplineCurve<4>& curve) {
  const std::vector<char> moved = moved_spans(curve);
  const double growth =
      std::isinf(largest_move_) ? PathFitRules::kFastGrowth : PathFitRules::kGrowth;
  const std::size_t count = stiffness_.size();
  std::vector<double> raised = stiffness_;
  bool any = false;
  for (std::size_t s = 0; s < count; ++s) {
    if (moved[s] != 0) continue;

    // Bends at the ends and quarters of the span: the tightest one speaks for it.
    double tightest = 0;
    for (const double f : {0.0, 0.25, 0.5, 0.75, 1.0}) {
      const double t = (static_cast<double>(s) + f) / static_cast<double>(count);
      tightest = std::max(tightest, bend_at(curve, t).tightness());
    }
    if (tightest <= kTightestBend) continue;

    any = true;
    const auto [low, high] = beside(s, count);
    for (std::size_t k = low; k < high; ++k) {
      const double next = std::max(stiffness_[k] * growth, PathFitRules::kFirstStep * growth);
      raised[k] = std::max(raised[k], next);
    }
  }
  stiffness_ = std::move(raised);
  return any;
}

AxisDeparture PathFit::departure(const BSplineCurve<4>& curve) const {
  return departure_from(curve, target_.points, target_.parameters);
}

std::vector<double> PathFit::slack() const {
  return std::vector<double>(stiffness_.size(), PathFitRules::kSlack);
}

// The target as it is, stiffened where bends ask for it, and free at its ends.
SplineFitProblem PathFit::target_problem() const {
  SplineFitProblem problem;
  problem.parameters = rail_.parameters;
  problem.values = rail_.points.transpose();
  const double stretch = rail_.radius_in_parameter();
  const double share = 1.0 / static_cast<double>(rail_.parameters.size());
  problem.weights.assign(rail_.parameters.size(), share / stretch);
  problem.bending = scaled(stiffness_, stretch, PathFitRules::kSlack);
  return problem;
}

// Bends are stiffened, radii are not.
BSplineCurve<4> PathFit::target_spline() const {
  SplineFitProblem problem = target_problem();
  Eigen::MatrixXd fitted = fit_spline(knots_, problem);
  problem.bending = scaled(slack(), rail_.radius_in_parameter(), PathFitRules::kSlack);
  problem.values = problem.values.rightCols<1>().eval();
  fitted.col(3) = fit_spline(knots_, problem).col(0);
  return BSplineCurve<4>(knots_, fitted.transpose());
}

double PathFit::tightest_within(double from, double to) const {
  constexpr int kSteps = 64;
  double largest = 0;
  for (int i = 0; i <= kSteps; ++i) {
    const double t = std::clamp(from + (to - from) * i / kSteps, 0.0, 1.0);
    largest = std::max(largest, bend_at(course_, t).tightness());
  }
  return largest;
}

// The spans near which the curve lies farther from its unstiffened course than it may.
std::vector<char> PathFit::moved_spans(const BSplineCurve<4>& curve) const {
  const std::size_t count = stiffness_.size();
  std::vector<char> moved(count, 0);
  for (std::size_t i = 0; i < rail_.parameters.size(); ++i) {
    const double t = rail_.parameters[i];
    const double away = (curve.at(t) - course_.at(t)).head<3>().norm();
    if (away <= largest_move_ * rail_.points(3, static_cast<Eigen::Index>(i))) continue;
    const auto span = static_cast<std::size_t>(t * static_cast<double>(count));
    const auto [low, high] = beside(std::min(count - 1, span), count);
    for (std::size_t k = low; k < high; ++k) moved[k] = 1;
  }
  return moved;
}

// As fine as the thinnest place asks: a stenosis is as short as it is narrow.
KnotVector PathFit::make_knots() const {
  const double thinnest =
      std::max(rail_.points.row(3).minCoeff(), PathFitRules::kFinest * rail_.mean_radius_mm);
  const double radii = rail_.length_mm / thinnest;
  const int spans = std::max(2, static_cast<int>(std::ceil(PathFitRules::kSpansPerRadius * radii)));
  std::vector<double> breaks;
  for (int s = 0; s <= spans; ++s) breaks.push_back(static_cast<double>(s) / spans);
  return KnotVector::clamped(kDegree, breaks);
}

}  // namespace angiospline
