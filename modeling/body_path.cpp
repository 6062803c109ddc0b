#include "modeling/body_path.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Geometry>

#include "base/contract.h"
#include "modeling/spline_fit.h"

namespace angiospline {
namespace {

constexpr int kDegree = 5;
constexpr double kSlack = 1e-4;  // bending stiffness where nothing asks for more
constexpr double kStiff = 4.0;   // near held ends: a turn by delta bends by about delta / radius
constexpr double kFirstStep = 0.0125;
constexpr int kRounds = 24;  // of stiffening bends that are too tight
constexpr double kSpansPerRadius = 1.5;

struct Rail {
  std::vector<double> parameters;  // of the target's columns, arc length over total length
  Eigen::Matrix4Xd points;
  double length_mm = 0.0;
  double mean_radius_mm = 0.0;
};

// Parameters by arc length, the ends' own points included.
Rail make_rail(const Eigen::Matrix4Xd& target, const PathEnd& start, const PathEnd& end) {
  Rail rail;
  rail.points.resize(4, target.cols() + 2);
  rail.points.col(0) << start.point_mm, start.radius_mm;
  rail.points.middleCols(1, target.cols()) = target;
  rail.points.rightCols<1>() << end.point_mm, end.radius_mm;
  double along = 0;
  for (Eigen::Index i = 0; i < rail.points.cols(); ++i) {
    if (i > 0) along += (rail.points.col(i) - rail.points.col(i - 1)).head<3>().norm();
    rail.parameters.push_back(along);
  }
  EXPECTS(along > 0);
  for (double& t : rail.parameters) t = std::min(1.0, t / along);
  rail.length_mm = along;
  rail.mean_radius_mm = rail.points.row(3).mean();
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

// Held control points: the end itself, and with a direction the next one along it.
Eigen::MatrixXd held_rows(const PathEnd& end, double step) {
  Eigen::RowVector4d row;
  row << end.point_mm.transpose(), end.radius_mm;
  if (end.direction.isZero()) return row;
  Eigen::MatrixXd rows(2, 4);
  rows.row(0) = row;
  rows.row(1) = row;
  rows.row(1).head<3>() += step * end.direction.transpose();
  return rows;
}

struct Bend {
  double parameter;
  double curvature;
  double radius;
};

Bend bend_at(const BSplineCurve<4>& curve, double t) {
  const Vec4 value = curve.at(t);
  const Vec3 d1 = curve.at(t, 1).head<3>();
  const Vec3 d2 = curve.at(t, 2).head<3>();
  const double speed = d1.norm();
  const double curvature = speed > 0 ? d1.cross(d2).norm() / (speed * speed * speed)
                                     : std::numeric_limits<double>::infinity();
  return {t, curvature, value(3)};
}

class PathFit {
 public:
  PathFit(Rail rail, const PathEnd& start, const PathEnd& end, double largest_move)
      : rail_(std::move(rail)),
        start_(start),
        end_(end),
        largest_move_(largest_move),
        knots_(make_knots()),
        course_(knots_, Eigen::Matrix4Xd::Zero(4, knots_.control_point_count())) {
    const std::size_t spans = knots_.breakpoints().size() - 1;
    stiffness_.assign(spans, kSlack);
    resample(rail_, 4 * static_cast<int>(spans) + 4);
    course_ = solve();
  }

  const BSplineCurve<4>& course() const { return course_; }

  // The target as a spline, then the correction that meets the ends: a stiff beam that starts from
  // what is missing there and dies out, so that bends of the target itself are not straightened.
  BSplineCurve<4> solve() const {
    const double reach = (knots_[kDegree + 1] - knots_[kDegree]) / kDegree * rail_.length_mm;
    const Eigen::MatrixXd first = held_rows(start_, reach);
    const Eigen::MatrixXd last = held_rows(end_, -reach).colwise().reverse();

    SplineFitProblem problem;
    problem.parameters = rail_.parameters;
    problem.values = rail_.points.transpose();
    const double stretch = rail_.mean_radius_mm / rail_.length_mm;  // one radius in the parameter
    const double share = 1.0 / static_cast<double>(rail_.parameters.size());
    problem.weights.assign(rail_.parameters.size(), share / stretch);
    problem.bending = scaled(stiffness_, stretch, kSlack);
    const Eigen::MatrixXd target = fit_spline(knots_, problem);

    problem.values.setZero();
    problem.bending = scaled(stiffness_, stretch, kStiff);
    problem.first = first - target.topRows(first.rows());
    problem.last = last - target.bottomRows(last.rows());
    return BSplineCurve<4>(knots_, (target + fit_spline(knots_, problem)).transpose());
  }

  // Bends at the ends and quarters of every span; the tightest one of a span stiffens it and its
  // neighbours, unless the path has left its target there already: then the radius has to give
  // way. False when nothing was stiffened.
  bool stiffen(const BSplineCurve<4>& curve) {
    const std::vector<char> moved = moved_spans(curve);
    // Small steps where the limit must not be overshot; large ones even the stiffness out.
    const double growth = std::isinf(largest_move_) ? 4 : 2;
    std::vector<double> raised = stiffness_;
    bool any = false;
    for (std::size_t s = 0; s < stiffness_.size(); ++s) {
      if (moved[s] != 0) continue;
      double tightest = 0;
      for (const double f : {0.0, 0.25, 0.5, 0.75, 1.0}) {
        const Bend bend =
            bend_at(curve, (static_cast<double>(s) + f) / static_cast<double>(stiffness_.size()));
        tightest = std::max(tightest, bend.curvature * bend.radius);
      }
      if (tightest <= kTightestBend) continue;
      any = true;
      const std::size_t low = s >= 2 ? s - 2 : 0;
      for (std::size_t k = low; k < std::min(s + 3, stiffness_.size()); ++k) {
        raised[k] = std::max(raised[k], std::max(stiffness_[k] * growth, kFirstStep * growth));
      }
    }
    stiffness_ = std::move(raised);
    return any;
  }

  double spans() const { return static_cast<double>(stiffness_.size()); }

 private:
  // The spans near which the curve lies farther from its unstiffened course than it may.
  std::vector<char> moved_spans(const BSplineCurve<4>& curve) const {
    std::vector<char> moved(stiffness_.size(), 0);
    for (std::size_t i = 0; i < rail_.parameters.size(); ++i) {
      const double t = rail_.parameters[i];
      const double away = (curve.at(t) - course_.at(t)).head<3>().norm();
      if (away <= largest_move_ * rail_.points(3, static_cast<Eigen::Index>(i))) continue;
      const auto s = std::min(stiffness_.size() - 1, static_cast<std::size_t>(t * spans()));
      for (std::size_t k = s >= 2 ? s - 2 : 0; k < std::min(s + 3, moved.size()); ++k) moved[k] = 1;
    }
    return moved;
  }

  KnotVector make_knots() const {
    const double radii = rail_.length_mm / rail_.mean_radius_mm;
    const int spans = std::max(2, static_cast<int>(std::ceil(kSpansPerRadius * radii)));
    std::vector<double> breaks;
    for (int s = 0; s <= spans; ++s) breaks.push_back(static_cast<double>(s) / spans);
    return KnotVector::clamped(kDegree, breaks);
  }

  // Stiffness per radius in the units of the parameter.
  static std::vector<double> scaled(const std::vector<double>& stiffness, double stretch,
                                    double least) {
    std::vector<double> bending;
    for (const double s : stiffness) {
      bending.push_back(std::max(s, least) * stretch * stretch * stretch);
    }
    return bending;
  }

  Rail rail_;
  PathEnd start_;
  PathEnd end_;
  double largest_move_;
  KnotVector knots_;
  std::vector<double> stiffness_;
  BSplineCurve<4> course_;  // before any stiffening
};

// Lowers radius control points where the bend is too tight for the radius.
BSplineCurve<4> narrow(const BSplineCurve<4>& curve, const std::vector<Bend>& bends) {
  Eigen::Matrix4Xd points = curve.control_points();
  const KnotVector& knots = curve.knots();
  for (const Bend& bend : bends) {
    if (bend.curvature * bend.radius <= kTightestBend) continue;
    const double factor = kTightestBend / (bend.curvature * bend.radius);
    const int first = knots.span(bend.parameter) - knots.degree();
    // The ends' own radii are their neighbours' too.
    for (int i = std::max(first, 2); i <= first + knots.degree() && i < points.cols() - 2; ++i) {
      points(3, i) = std::min(points(3, i), factor * bend.radius);
    }
  }
  return BSplineCurve<4>(knots, std::move(points));
}

std::vector<Bend> bends_of(const BSplineCurve<4>& curve, int count) {
  std::vector<Bend> bends;
  for (int i = 0; i <= count; ++i) bends.push_back(bend_at(curve, static_cast<double>(i) / count));
  return bends;
}

double tightest(const std::vector<Bend>& bends) {
  double largest = 0;
  for (const Bend& b : bends) largest = std::max(largest, b.curvature * b.radius);
  return largest;
}

BodyPath fit_within(const Rail& rail, const PathEnd& start, const PathEnd& end,
                    double largest_move) {
  PathFit fit(rail, start, end, largest_move);
  BSplineCurve<4> curve = fit.course();
  for (int round = 0; round < kRounds && fit.stiffen(curve); ++round) curve = fit.solve();

  const int samples = static_cast<int>(4 * fit.spans());
  std::vector<Bend> bends = bends_of(curve, samples);
  BodyPath path{curve, tightest(bends), 0.0};
  if (path.largest_bend <= kTightestBend) return path;
  path.curve = narrow(curve, bends);
  for (const Bend& before : bends) {
    path.narrowed = std::max(path.narrowed, 1 - path.curve.at(before.parameter)(3) / before.radius);
  }
  path.largest_bend = tightest(bends_of(path.curve, samples));
  return path;
}

}  // namespace

BodyPath fit_body_path(const Eigen::Matrix4Xd& target, const PathEnd& start, const PathEnd& end) {
  EXPECTS(target.cols() >= 2);
  EXPECTS(start.radius_mm > 0 && end.radius_mm > 0);
  const Rail rail = make_rail(target, start, end);
  for (const double largest_move : {kLargestPathMove, 1.0}) {
    BodyPath path = fit_within(rail, start, end, largest_move);
    if (path.narrowed <= kMostNarrowed) return path;
  }
  return fit_within(rail, start, end, std::numeric_limits<double>::infinity());
}

}  // namespace angiospline
