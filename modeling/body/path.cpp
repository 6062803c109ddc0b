#include "modeling/body/path.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "base/contract.h"
#include "base/index.h"
#include "modeling/body/path_fit.h"
#include "modeling/body/rules.h"

namespace angiospline {
namespace {

// Lowers the radius where the bend is too tight for it, each control point near it by its own
// share.
BSplineCurve<4> narrow(const BSplineCurve<4>& curve, const std::vector<Bend>& bends,
                       double largest) {
  Eigen::Matrix4Xd points = curve.control_points();
  const KnotVector& knots = curve.knots();
  Eigen::VectorXd factors = Eigen::VectorXd::Ones(points.cols());
  const std::vector<double> breaks = knots.breakpoints();
  const double near =
      PathLadderRules::kNarrowedSpans * knots.last() / static_cast<double>(breaks.size() - 1);
  for (const Bend& bend : bends) {
    if (bend.tightness() <= largest) continue;
    const double factor = largest / bend.tightness();

    // The ends' own radii are their neighbours' too.
    const int first = knots.span(bend.parameter) - knots.degree();
    for (int i = std::max(first, 2); i <= first + knots.degree() && i < points.cols() - 2; ++i) {
      if (std::abs(knots.greville(i) - bend.parameter) > near) continue;
      factors(i) = std::min(factors(i), factor);
    }
  }
  points.row(3).array() *= factors.transpose().array();
  return BSplineCurve<4>(knots, std::move(points));
}

struct Attempt {
  BodyPath path;
  double cost = 0.0;  // 1: as much as should be given up of the radius, or of the centerline
};

// A way to fit a path: whether the target is led in, and how far stiffening may move the path.
struct Way {
  bool lead_in;
  double largest_move;  // radii
};

constexpr Way kAnyWay{false, std::numeric_limits<double>::infinity()};
constexpr std::array<Way, 5> kWays{
    Way{false, kLargestPathMove}, Way{false, PathLadderRules::kMoreMove},
    Way{true, kLargestPathMove}, Way{true, PathLadderRules::kMoreMove}, kAnyWay};

// Narrows the radius of a path until no bend is too tight for it, and says by how much.
void narrow_bends(BodyPath& path, const std::vector<Bend>& before, double tightest_bend,
                  int samples) {
  std::vector<Bend> bends = before;
  for (int round = 0; round < PathLadderRules::kNarrowings && tightest(bends) > tightest_bend;
       ++round) {
    path.curve = narrow(path.curve, bends, tightest_bend);
    bends = bends_of(path.curve, samples);
  }
  for (const Bend& bend : before) {
    path.narrowed = std::max(path.narrowed, 1 - path.curve.at(bend.parameter)(3) / bend.radius);
  }
  path.largest_bend = tightest(bends);
}

Attempt fit_by(const Way& way, const Rail& rail, const PathEnd& start, const PathEnd& end,
               double tightest_bend) {
  PathFit fit(rail, start, end, way.largest_move);
  if (way.lead_in) fit.lead_in();
  BSplineCurve<4> curve = fit.course();
  for (int round = 0; round < PathLadderRules::kRounds && fit.stiffen(curve); ++round) {
    curve = fit.solve();
  }

  // What leaves the target costs, and more than in proportion once it is out of the lumen.
  const int samples = 4 * fit.span_count();
  const std::vector<Bend> bends = bends_of(curve, samples);
  const double departure = fit.departure(curve).radii / PathLadderRules::kLargestDeparture;
  const bool is_lost = departure > PathLadderRules::kLost;
  Attempt attempt{{curve, tightest(bends), 0.0}, departure * std::max(1.0, departure)};
  if (is_lost) attempt.cost += PathLadderRules::kFoldCost;
  if (attempt.path.largest_bend <= tightest_bend) return attempt;

  // What narrows the radius costs likewise; the larger of the two counts.
  narrow_bends(attempt.path, bends, tightest_bend, samples);
  attempt.cost = std::max(attempt.cost, attempt.path.narrowed / kMostNarrowed);
  if (attempt.path.narrowed > PathLadderRules::kThroat && !is_lost) {
    attempt.cost += PathLadderRules::kFoldCost;
  }
  return attempt;
}

}  // namespace

BodyPath fit_body_path(const Eigen::Matrix4Xd& target, const PathEnd& start, const PathEnd& end,
                       PathFreedom freedom) {
  EXPECTS(target.cols() >= 2);
  EXPECTS(start.radius_mm > 0 && end.radius_mm > 0);
  const Rail rail = make_rail(target, start, end);
  const double bend =
      freedom == PathFreedom::kNarrower ? PathLadderRules::kNarrowerBend : kTightestBend;

  // The first way that gives up little is taken, or else the one that gives up least.
  std::optional<Attempt> best;
  for (const Way& way : kWays) {
    if (freedom == PathFreedom::kAnyMove && !std::isinf(way.largest_move)) continue;
    Attempt attempt = fit_by(way, rail, start, end, bend);
    if (!best || attempt.cost < best->cost) best = std::move(attempt);
    if (best->cost <= PathLadderRules::kGoodEnough) break;
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

  // Only near its own parameter: where a vessel comes back beside itself the other leg is no place
  // of this point.
  AxisDeparture worst;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const Vec4 place = points.col(static_cast<Eigen::Index>(i));
    const int here = static_cast<int>(parameters[i] * count);
    const int window =
        static_cast<int>(std::ceil(PathLadderRules::kNearTarget * place(3) / length * count));
    double nearest = std::numeric_limits<double>::infinity();
    for (int k = std::max(0, here - window); k <= std::min(count, here + window); ++k) {
      const Vec3 at = axis[index(k)].head<3>();
      nearest = std::min(nearest, (place.head<3>() - at).norm());
    }
    if (nearest > worst.mm) worst = {nearest, nearest / place(3)};
  }
  return worst;
}

}  // namespace angiospline
