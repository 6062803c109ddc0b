#include "modeling/body/path.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "base/contract.h"
#include "kernel/fit/penalised_curve.h"
#include "modeling/body/lead_in.h"

namespace angiospline {
namespace {

constexpr int kDegree = 5;
constexpr double kSlack = 1e-4;  // bending stiffness where nothing asks for more
constexpr double kStiff = 4.0;   // near held ends: a turn by delta bends by about delta / radius
constexpr double kSlackRadius =
    1e-3;  // a slope of the radius that is missing there dies out at once
constexpr double kFirstStep = 0.0125;
constexpr int kRounds = 24;  // of stiffening bends that are too tight
constexpr int kNarrowings = 4;
// Of the path's even spans to either side of a bend: control points there hold all but a sixtieth
// of the radius in it.
constexpr double kNarrowedSpans = 1.6;
constexpr double kNarrowerBend = 0.6;
constexpr double kSpansPerRadius = 1.5;
constexpr double kFinest = 0.33;      // of the mean radius
constexpr double kNearEnd = 5.0;      // radii within which a bend is the end's
constexpr double kLeadBend = 0.65;    // that a lead-in should keep, so that the fit to it has room
constexpr double kNearTarget = 10.0;  // radii of way within which a point finds its place again
constexpr double kThroat = 0.4;       // of the radius given up: the wall is likely to fold there
constexpr double kFoldCost = 1e3;     // worse than any departure
constexpr double kLargestDeparture = 2.0;  // radii as bad as giving up kMostNarrowed of the radius
constexpr double kLost = 2.0;              // times that: a part of the vessel is cut off
constexpr double kGoodEnough = 0.5;        // of these two: no other way is looked for

struct Rail {
  std::vector<double> parameters;  // of the target's columns, arc length over total length
  Eigen::Matrix4Xd points;
  double length_mm = 0.0;
  double mean_radius_mm = 0.0;
};

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

// The target with the ends' own points.
Rail make_rail(const Eigen::Matrix4Xd& target, const PathEnd& start, const PathEnd& end) {
  Eigen::Matrix4Xd points(4, target.cols() + 2);
  points.col(0) << start.point_mm, start.radius_mm;
  points.middleCols(1, target.cols()) = target;
  points.rightCols<1>() << end.point_mm, end.radius_mm;
  return rail_through(std::move(points));
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
      : rail_(rail),
        target_(std::move(rail)),
        start_(start),
        end_(end),
        largest_move_(largest_move),
        knots_(make_knots()),
        course_(knots_, Eigen::Matrix4Xd::Zero(4, knots_.control_point_count())) {
    prepare();
  }

  // Where the path would bend too tightly near an end, the target is led in from there.
  void lead_in() {
    const double near = kNearEnd * rail_.mean_radius_mm / rail_.length_mm;
    const bool at_first = !start_.direction.isZero() && tightest_within(0, near) > kTightestBend;
    const bool at_last = !end_.direction.isZero() && tightest_within(1 - near, 1) > kTightestBend;
    if (!at_first && !at_last) return;
    const double most = at_first && at_last ? 0.45 : 0.9;
    const BSplineCurve<4> course = target_spline();
    std::optional<LeadIn> first, last;
    if (at_first) first = find_lead_in(course, false, start_, kLeadBend, most);
    if (at_last) last = find_lead_in(course, true, end_, kLeadBend, most);
    const double from = first ? first->joins_at : 0;
    const double to = last ? 1 - last->joins_at : 1;
    std::vector<Vec4> points;
    if (first) {
      for (const auto& p : first->samples.colwise()) points.emplace_back(p);
    }
    for (std::size_t i = 0; i < rail_.parameters.size(); ++i) {
      const double t = rail_.parameters[i];
      if (t >= from && t <= to) points.emplace_back(rail_.points.col(static_cast<Eigen::Index>(i)));
    }
    if (last) {
      for (Eigen::Index i = last->samples.cols(); i-- > 0;) {
        points.emplace_back(last->samples.col(i));
      }
    }
    rail_ = rail_through(Eigen::Map<Eigen::Matrix4Xd>(points.front().data(), 4,
                                                      static_cast<Eigen::Index>(points.size())));
    knots_ = make_knots();
    prepare();
  }

  const BSplineCurve<4>& course() const { return course_; }

  // The target as a spline, then the correction that meets the ends: a stiff beam that starts from
  // what is missing there and dies out, so that bends of the target itself are not straightened.
  BSplineCurve<4> solve() const {
    const double reach = (knots_[kDegree + 1] - knots_[kDegree]) / kDegree * rail_.length_mm;
    const Eigen::MatrixXd first = held_rows(start_, reach);
    const Eigen::MatrixXd last = held_rows(end_, -reach).colwise().reverse();

    const Eigen::MatrixXd target = target_spline().control_points().transpose();
    SplineFitProblem problem = target_problem();
    const double stretch = rail_.mean_radius_mm / rail_.length_mm;
    problem.values.setZero();
    problem.bending = scaled(stiffness_, stretch, kStiff);
    problem.first = first - target.topRows(first.rows());
    problem.last = last - target.bottomRows(last.rows());
    Eigen::MatrixXd correction = fit_spline(knots_, problem);
    problem.bending = scaled(slack(), stretch, kSlackRadius);
    correction.col(3) = fit_spline(knots_, problem).col(3);
    return BSplineCurve<4>(knots_, (target + correction).transpose());
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

  // Of the target as it was given.
  AxisDeparture departure(const BSplineCurve<4>& curve) const {
    return departure_from(curve, target_.points, target_.parameters);
  }

  double spans() const { return static_cast<double>(stiffness_.size()); }

 private:
  void prepare() {
    const std::size_t spans = knots_.breakpoints().size() - 1;
    stiffness_.assign(spans, kSlack);
    resample(rail_, 4 * static_cast<int>(spans) + 4);
    course_ = solve();
  }

  std::vector<double> slack() const { return std::vector<double>(stiffness_.size(), kSlack); }

  // The target as it is, stiffened where bends ask for it, and free at its ends.
  SplineFitProblem target_problem() const {
    SplineFitProblem problem;
    problem.parameters = rail_.parameters;
    problem.values = rail_.points.transpose();
    const double stretch = rail_.mean_radius_mm / rail_.length_mm;  // one radius in the parameter
    const double share = 1.0 / static_cast<double>(rail_.parameters.size());
    problem.weights.assign(rail_.parameters.size(), share / stretch);
    problem.bending = scaled(stiffness_, stretch, kSlack);
    return problem;
  }
  // Bends are stiffened, radii are not.
  BSplineCurve<4> target_spline() const {
    SplineFitProblem problem = target_problem();
    Eigen::MatrixXd fitted = fit_spline(knots_, problem);
    problem.bending = scaled(slack(), rail_.mean_radius_mm / rail_.length_mm, kSlack);
    problem.values = problem.values.rightCols<1>().eval();
    fitted.col(3) = fit_spline(knots_, problem).col(0);
    return BSplineCurve<4>(knots_, fitted.transpose());
  }

  double tightest_within(double from, double to) const {
    constexpr int kSteps = 64;
    double largest = 0;
    for (int i = 0; i <= kSteps; ++i) {
      const double t = std::clamp(from + (to - from) * i / kSteps, 0.0, 1.0);
      const Bend bend = bend_at(course_, t);
      largest = std::max(largest, bend.curvature * bend.radius);
    }
    return largest;
  }

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
    // As fine as the thinnest place asks: a stenosis is as short as it is narrow.
    const double thinnest =
        std::max(rail_.points.row(3).minCoeff(), kFinest * rail_.mean_radius_mm);
    const double radii = rail_.length_mm / thinnest;
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
  Rail target_;  // as given, before it was led in or resampled
  PathEnd start_;
  PathEnd end_;
  double largest_move_;
  KnotVector knots_;
  std::vector<double> stiffness_;
  BSplineCurve<4> course_;  // before any stiffening
};

// Lowers the radius where the bend is too tight for it, each control point near it by its own
// share.
BSplineCurve<4> narrow(const BSplineCurve<4>& curve, const std::vector<Bend>& bends,
                       double tightest) {
  Eigen::Matrix4Xd points = curve.control_points();
  const KnotVector& knots = curve.knots();
  Eigen::VectorXd factors = Eigen::VectorXd::Ones(points.cols());
  const std::vector<double> breaks = knots.breakpoints();
  const double near = kNarrowedSpans * knots.last() / static_cast<double>(breaks.size() - 1);
  for (const Bend& bend : bends) {
    if (bend.curvature * bend.radius <= tightest) continue;
    const double factor = tightest / (bend.curvature * bend.radius);
    const int first = knots.span(bend.parameter) - knots.degree();
    // The ends' own radii are their neighbours' too.
    for (int i = std::max(first, 2); i <= first + knots.degree() && i < points.cols() - 2; ++i) {
      if (std::abs(knots.greville(i) - bend.parameter) > near) continue;
      factors(i) = std::min(factors(i), factor);
    }
  }
  points.row(3).array() *= factors.transpose().array();
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

struct Attempt {
  BodyPath path;
  double cost = 0.0;  // 1: as much as should be given up of the radius, or of the centerline
};

// What may be tried: to lead the target in, and how far stiffening may move the path.
struct Leave {
  bool lead_in;
  double largest_move;
};

constexpr Leave kAnyMove{false, std::numeric_limits<double>::infinity()};

Attempt fit_within(const Rail& rail, const PathEnd& start, const PathEnd& end, const Leave& leave,
                   double tightest_bend) {
  PathFit fit(rail, start, end, leave.largest_move);
  if (leave.lead_in) fit.lead_in();
  BSplineCurve<4> curve = fit.course();
  for (int round = 0; round < kRounds && fit.stiffen(curve); ++round) curve = fit.solve();

  const int samples = static_cast<int>(4 * fit.spans());
  std::vector<Bend> bends = bends_of(curve, samples);
  const double departure = fit.departure(curve).radii / kLargestDeparture;
  Attempt attempt{{curve, tightest(bends), 0.0}, departure * std::max(1.0, departure)};
  if (departure > kLost) attempt.cost += kFoldCost;
  BodyPath& path = attempt.path;
  if (path.largest_bend <= tightest_bend) return attempt;
  const std::vector<Bend> before = bends;
  for (int round = 0; round < kNarrowings && tightest(bends) > tightest_bend; ++round) {
    path.curve = narrow(path.curve, bends, tightest_bend);
    bends = bends_of(path.curve, samples);
  }
  for (const Bend& bend : before) {
    path.narrowed = std::max(path.narrowed, 1 - path.curve.at(bend.parameter)(3) / bend.radius);
  }
  path.largest_bend = tightest(bends);
  attempt.cost = std::max(attempt.cost, path.narrowed / kMostNarrowed);
  if (path.narrowed > kThroat && departure <= kLost) attempt.cost += kFoldCost;
  return attempt;
}

}  // namespace

BodyPath fit_body_path(const Eigen::Matrix4Xd& target, const PathEnd& start, const PathEnd& end,
                       PathFreedom freedom) {
  EXPECTS(target.cols() >= 2);
  EXPECTS(start.radius_mm > 0 && end.radius_mm > 0);
  const Rail rail = make_rail(target, start, end);
  std::optional<Attempt> best;
  for (const Leave& leave : {Leave{false, kLargestPathMove}, Leave{false, 1.0},
                             Leave{true, kLargestPathMove}, Leave{true, 1.0}, kAnyMove}) {
    if (freedom == PathFreedom::kAnyMove && !std::isinf(leave.largest_move)) continue;
    Attempt attempt = fit_within(rail, start, end, leave,
                                 freedom == PathFreedom::kNarrower ? kNarrowerBend : kTightestBend);
    if (!best || attempt.cost < best->cost) best = std::move(attempt);
    if (best->cost <= kGoodEnough) break;
  }
  return std::move(best->path);
}

AxisDeparture departure_from(const BSplineCurve<4>& curve, const Eigen::Matrix4Xd& points,
                             const std::vector<double>& parameters) {
  EXPECTS(static_cast<Eigen::Index>(parameters.size()) == points.cols());
  const int count = 8 * curve.knots().control_point_count();
  std::vector<Vec4> axis;
  double length = 0;
  for (int k = 0; k <= count; ++k) {
    axis.push_back(curve.at(static_cast<double>(k) / count));
    if (k > 0) length += (axis.back() - axis[axis.size() - 2]).head<3>().norm();
  }
  AxisDeparture worst;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const Vec4 place = points.col(static_cast<Eigen::Index>(i));
    const int here = static_cast<int>(parameters[i] * count);
    const int window = static_cast<int>(std::ceil(kNearTarget * place(3) / length * count));
    double nearest = std::numeric_limits<double>::infinity();
    for (int k = std::max(0, here - window); k <= std::min(count, here + window); ++k) {
      const Vec3 at = axis[static_cast<std::size_t>(k)].head<3>();
      nearest = std::min(nearest, (place.head<3>() - at).norm());
    }
    if (nearest > worst.mm) worst = {nearest, nearest / place(3)};
  }
  return worst;
}

}  // namespace angiospline
