#include "modeling/body/body.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Geometry>

#include "base/contract.h"
#include "kernel/fit/penalised_curve.h"
#include "kernel/spline/basis.h"
#include "modeling/body/rules.h"
#include "modeling/body/seams.h"

namespace angiospline {
namespace {

// ---------------------------------------------------------------- frames along the path

Vec3 any_orthogonal(const Vec3& t) {
  Eigen::Index axis = 0;
  t.cwiseAbs().minCoeff(&axis);
  return t.cross(Vec3::Unit(axis)).normalized();
}

Vec3 reflect(const Vec3& x, const Vec3& v) {
  const double c = v.squaredNorm();
  return c > 0 ? Vec3(x - (2 * v.dot(x) / c) * v) : x;
}

// Frames that turn about the path no more than it makes them: the double reflection of Wang,
// Juettler, Zheng, Liu 2008, ACM TOG 27(1), table I.
std::vector<Station> stations_along(const BSplineCurve<4>& path, const BodyEnd& start,
                                    const BodyEnd& end, int count) {
  std::vector<Station> stations;
  Vec3 e = Vec3::Zero();
  Vec3 before_point = Vec3::Zero();
  Vec3 before_tangent = Vec3::Zero();
  for (int i = 0; i <= count; ++i) {
    const double t = static_cast<double>(i) / count;
    const Vec4 value = path.at(t);
    Vec3 tangent = path.at(t, 1).head<3>().normalized();
    if (i == 0) tangent = start.tangent;
    if (i == count) tangent = end.tangent;

    const Vec3 point = value.head<3>();
    if (i == 0) {
      e = any_orthogonal(tangent);
    } else {
      // First in the plane that bisects the two points, then in the one that takes the tangent that
      // came out of that to the tangent that is there.
      const Vec3 v = point - before_point;
      const Vec3 moved = reflect(before_tangent, v);
      e = reflect(reflect(e, v), tangent - moved);
    }
    e = (e - e.dot(tangent) * tangent).normalized();
    stations.push_back({point, e, tangent.cross(e), value(3)});
    before_point = point;
    before_tangent = tangent;
  }
  return stations;
}

// 0 to 1 with two vanishing derivatives at both ends.
double smooth_step(double t) { return t * t * t * (10 + t * (6 * t - 15)); }

// ---------------------------------------------------------------- the fit along u

struct Sweep {
  std::vector<double> parameters;
  Eigen::MatrixXd values;  // row: station; columns: x, y, z of each ring point in turn
  std::vector<double> radii;
};

Sweep sweep_rings(const std::vector<Station>& stations, const RingShape& start,
                  const RingShape& end) {
  Sweep sweep;
  const auto count = static_cast<Eigen::Index>(stations.size());
  sweep.values.resize(count, static_cast<Eigen::Index>(15 * start.size()));
  for (Eigen::Index i = 0; i < count; ++i) {
    const double t = static_cast<double>(i) / static_cast<double>(count - 1);

    const Station& station = stations[static_cast<std::size_t>(i)];
    const std::vector<Vec2> ring = blend_rings(start, end, smooth_step(t));
    for (std::size_t c = 0; c < ring.size(); ++c) {
      sweep.values.row(i).segment<3>(static_cast<Eigen::Index>(3 * c)) = station.world(ring[c]);
    }
    sweep.parameters.push_back(t);
    sweep.radii.push_back(station.radius);
  }
  return sweep;
}

// The ring as one row of the fit.
Eigen::RowVectorXd as_row(const Points3& ring) {
  return Eigen::Map<const Eigen::RowVectorXd>(ring.data(), ring.size());
}

// How a joined end's row moves on along the path: affine in the point, parallel to the tangent.
struct Departure {
  Vec3 velocity;   // of the center, per parameter
  Vec3 curvature;  // vector, orthogonal to the tangent
  Vec3 center;

  Vec3 at(const Vec3& point) const { return velocity * (1 - curvature.dot(point - center)); }
};

Departure departure_at(const BSplineCurve<4>& path, double t, const BodyEnd& end) {
  const Vec3 d1 = path.at(t, 1).head<3>();
  const Vec3 d2 = path.at(t, 2).head<3>();
  Vec3 curvature = (d2 - d2.dot(end.tangent) * end.tangent) / d1.squaredNorm();
  // The multiple stays positive all round even where the path itself bends too tightly.
  const double bend = curvature.norm() * end.radius_mm;
  if (bend > kTightestBend) curvature *= kTightestBend / bend;
  return {d1.norm() * end.tangent, curvature, end.center_mm};
}

Eigen::MatrixXd held_rows(const Eigen::RowVectorXd& row, const BodyEnd& end,
                          const Departure& departure, double step) {
  if (!end.joined) return row;
  Eigen::MatrixXd rows(2, row.size());
  rows.row(0) = row;
  for (Eigen::Index c = 0; c < row.size(); c += 3) {
    const Vec3 point = row.segment<3>(c);
    rows.row(1).segment<3>(c) = point + step * departure.at(point);
  }
  return rows;
}

// Largest deviation in radii on each span of the knots.
std::vector<double> deviations(const KnotVector& knots, const Eigen::MatrixXd& control,
                               const Sweep& sweep) {
  const std::vector<double> breaks = knots.breakpoints();
  std::vector<double> worst(breaks.size() - 1, 0.0);
  std::size_t span = 0;
  for (std::size_t i = 0; i < sweep.parameters.size(); ++i) {
    const double t = sweep.parameters[i];
    while (span + 1 < worst.size() && t >= breaks[span + 1]) ++span;
    const BasisValues b = basis_at(knots, t);
    const Eigen::RowVectorXd off = b.values.row(0) * control.middleRows(b.first, knots.order()) -
                                   sweep.values.row(static_cast<Eigen::Index>(i));
    for (Eigen::Index c = 0; c < off.size(); c += 3) {
      worst[span] = std::max(worst[span], off.segment<3>(c).norm() / sweep.radii[i]);
    }
  }
  return worst;
}

// A new breakpoint in the middle of every span above the tolerance, as long as stations are left to
// determine it.
std::vector<double> bisected(const std::vector<double>& breaks, const std::vector<double>& worst,
                             double tolerance, std::size_t stations) {
  std::vector<double> finer{breaks.front()};
  for (std::size_t s = 0; s < worst.size(); ++s) {
    const double width = breaks[s + 1] - breaks[s];
    if (worst[s] > tolerance &&
        width * static_cast<double>(stations) >= SweepRules::kStationsToHalve) {
      finer.push_back(breaks[s] + width / 2);
    }
    finer.push_back(breaks[s + 1]);
  }
  return finer;
}

// Both rows of a closed ring of control points at one u: the points of the isoparametric curve and
// their derivatives in u, with the first point once more at the end.
struct RingAt {
  Points3 points;
  Points3 derivatives;
};

RingAt ring_at(const Body& body, double u) {
  const BasisValues basis = basis_at(body.u, u, 1);
  RingAt ring{Points3::Zero(3, body.ring() + 1), Points3::Zero(3, body.ring() + 1)};
  for (int i = 0; i < body.u.order(); ++i) {
    const auto row = body.net.middleCols((basis.first + i) * body.ring(), body.ring());
    ring.points.leftCols(body.ring()) += basis.values(0, i) * row;
    ring.derivatives.leftCols(body.ring()) += basis.values(1, i) * row;
  }
  ring.points.rightCols<1>() = ring.points.col(0);
  ring.derivatives.rightCols<1>() = ring.derivatives.col(0);
  return ring;
}

// Least (Su x Sv) . outward over its mean, on a grid of every strip.
template <typename Center>
double jacobian_ratio(const Body& body, const Center& center_at) {
  constexpr int kSteps = SweepRules::kJacobianSteps;
  const KnotVector bezier = KnotVector::bezier(5);
  const std::vector<double> breaks = body.u.breakpoints();
  double least = std::numeric_limits<double>::infinity();
  double sum = 0;
  int count = 0;
  const auto measure = [&](const RingAt& ring, const Vec3& center, std::size_t strip, double v) {
    const BasisValues basis = basis_at(bezier, v, 1);
    const auto first = static_cast<Eigen::Index>(5 * strip);
    const Vec3 p = ring.points.middleCols<6>(first) * basis.values.row(0).transpose();
    const Vec3 pv = ring.points.middleCols<6>(first) * basis.values.row(1).transpose();
    const Vec3 pu = ring.derivatives.middleCols<6>(first) * basis.values.row(0).transpose();
    const double area = pu.cross(pv).dot((p - center).normalized());
    least = std::min(least, area);
    sum += area;
    ++count;
  };

  // Every span of u, and of every strip the places that its neighbour does not begin with.
  for (std::size_t s = 0; s + 1 < breaks.size(); ++s) {
    for (int a = 0; a <= kSteps; ++a) {
      const double u = breaks[s] + (breaks[s + 1] - breaks[s]) * a / kSteps;
      const RingAt ring = ring_at(body, u);
      const Vec3 center = center_at(u);
      for (std::size_t k = 0; k < body.strips.size(); ++k) {
        for (const double v : {0.0, 0.25, 0.5, 0.75}) measure(ring, center, k, v);
      }
    }
  }
  return sum > 0 ? least / (sum / count) : -1.0;
}

// The arcs of one station, moved to another.
std::vector<Arc> carried_arcs(const std::vector<Arc>& arcs, const Station& from,
                              const Station& to) {
  std::vector<Arc> carried = arcs;
  for (Arc& arc : carried) {
    for (int j = 0; j < 6; ++j) arc.col(j) = to.world(from.local(arc.col(j)));
  }
  return carried;
}

// Ends without arcs take them from the other; if neither has any, two arcs about the path.
void take_arcs(const Station& first, const Station& last, BodyEnd& start, BodyEnd& end) {
  if (start.arcs.empty() && end.arcs.empty()) {
    start.arcs = two_arc_circle(first.center, first.radius, start.tangent, first.e1);
  }
  if (start.arcs.empty()) start.arcs = carried_arcs(end.arcs, last, first);
  if (end.arcs.empty()) end.arcs = carried_arcs(start.arcs, first, last);
}

// The body's net: all points of the ring fitted over u by one linear operator, so that what holds
// between neighbours at every station holds between their splines. Spans are halved until the net
// is within the tolerance of the sweep.
void fit_net(const BSplineCurve<4>& path, const BodyEnd& start, const BodyEnd& end,
             const Sweep& sweep, double tolerance, Body& body) {
  SplineFitProblem problem;
  problem.parameters = sweep.parameters;
  problem.values = sweep.values;
  const Eigen::RowVectorXd first_row = as_row(ring_on_arcs(body.strips, start, true));
  const Eigen::RowVectorXd last_row = as_row(ring_on_arcs(body.strips, end, false));
  const Departure leaving = departure_at(path, 0.0, start);
  const Departure arriving = departure_at(path, 1.0, end);

  std::vector<double> breaks{0.0, 1.0};
  Eigen::MatrixXd control;
  for (;;) {
    body.u = KnotVector::clamped(5, breaks);
    problem.first = held_rows(first_row, start, leaving, (breaks[1] - breaks[0]) / 5);
    problem.last =
        held_rows(last_row, end, arriving, -(breaks.back() - breaks[breaks.size() - 2]) / 5)
            .colwise()
            .reverse();
    control = fit_spline(body.u, problem);
    const std::vector<double> worst = deviations(body.u, control, sweep);
    body.deviation = *std::max_element(worst.begin(), worst.end());
    std::vector<double> finer = bisected(breaks, worst, tolerance, sweep.parameters.size());
    if (finer.size() == breaks.size()) break;
    breaks = std::move(finer);
  }

  body.net.resize(3, static_cast<Eigen::Index>(body.rows()) * body.ring());
  for (int i = 0; i < body.rows(); ++i) {
    for (int c = 0; c < body.ring(); ++c) {
      body.net.col(i * body.ring() + c) = control.row(i).segment<3>(3 * c).transpose();
    }
  }
}

}  // namespace

BodyEnd free_end(const BSplineCurve<4>& path, double t) {
  const Vec4 value = path.at(t);
  return {value.head<3>(), path.at(t, 1).head<3>().normalized(), value(3), {}, false};
}

std::vector<Arc> two_arc_circle(const Vec3& center, double radius, const Vec3& tangent,
                                const Vec3& seam) {
  // The quintic nearest to a half circle; the tangents at its ends are exact.
  constexpr double kA = 0.668198, kB = 1.265900, kC = 0.442084;

  const Vec3 across = -tangent.cross(seam);  // a quarter turn clockwise about the tangent
  std::vector<Arc> arcs(2);
  const std::array<double, 6> along{1, 1, kC, -kC, -1, -1};
  const std::array<double, 6> side{0, kA, kB, kB, kA, 0};
  for (int j = 0; j < 6; ++j) {
    const Vec3 offset = radius * (along[static_cast<std::size_t>(j)] * seam +
                                  side[static_cast<std::size_t>(j)] * across);
    arcs[0].col(j) = center + offset;
    arcs[1].col(j) = center - offset;
  }
  return arcs;
}

Body make_body(const BodyPath& path, BodyEnd start, BodyEnd end, const BodyOptions& options) {
  EXPECTS(options.tolerance > 0);
  const int spans = static_cast<int>(path.curve.knots().breakpoints().size()) - 1;
  const int count = std::max(SweepRules::kFewestStations, SweepRules::kStationsPerSpan * spans);
  if (start.tangent.isZero()) start = free_end(path.curve, 0.0);
  if (end.tangent.isZero()) end = free_end(path.curve, 1.0);
  const std::vector<Station> stations = stations_along(path.curve, start, end, count);
  take_arcs(stations.front(), stations.back(), start, end);

  const SeamMatching match = match_seams(start, end, stations.front(), stations.back());
  Body body;
  body.strips = match.strips;
  body.twist_rad = match.twist_rad;
  fit_net(path.curve, start, end, sweep_rings(stations, match.start, match.end), options.tolerance,
          body);
  body.jacobian_ratio =
      jacobian_ratio(body, [&](double u) { return Vec3(path.curve.at(u).head<3>()); });
  return body;
}

Body make_lofted_body(const BodyEnd& start, const BodyEnd& end) {
  EXPECTS(!start.arcs.empty() && !end.arcs.empty());
  // The end's frame is the start's, turned as little as takes one tangent to the other.
  const Vec3 e = any_orthogonal(start.tangent);
  const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(start.tangent, end.tangent);
  const Vec3 f = turn * e;
  const Station first{start.center_mm, e, start.tangent.cross(e), start.radius_mm};
  const Station last{end.center_mm, f, end.tangent.cross(f), end.radius_mm};
  const SeamMatching match = match_seams(start, end, first, last);
  const Points3 a = ring_on_arcs(match.strips, start, true);
  const Points3 d = ring_on_arcs(match.strips, end, false);

  // Each point leaves along its end's tangent by a third of its way to the other end's plane, which
  // is an affine function of the point.
  Points3 b = a;
  Points3 c = d;
  const double facing = start.tangent.dot(end.tangent);
  for (Eigen::Index k = 0; k < a.cols(); ++k) {
    const double forward = (end.center_mm - a.col(k)).dot(end.tangent) / facing;
    const double backward = (d.col(k) - start.center_mm).dot(start.tangent) / facing;
    b.col(k) += forward / 3 * start.tangent;
    c.col(k) -= backward / 3 * end.tangent;
  }

  // One span of degree five in both directions: the cubics with their degree raised twice.
  Body body;
  body.strips = match.strips;
  body.twist_rad = match.twist_rad;
  const int ring = body.ring();
  body.net.resize(3, 6 * static_cast<Eigen::Index>(ring));
  body.net << a, (2 * a + 3 * b) / 5, (a + 6 * b + 3 * c) / 10, (3 * b + 6 * c + d) / 10,
      (3 * c + 2 * d) / 5, d;
  body.jacobian_ratio = jacobian_ratio(
      body, [&](double u) { return Vec3((1 - u) * start.center_mm + u * end.center_mm); });
  return body;
}

}  // namespace angiospline
