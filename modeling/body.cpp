#include "modeling/body.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

#include <Eigen/Geometry>

#include "base/contract.h"
#include "kernel/basis.h"
#include "modeling/spline_fit.h"

namespace angiospline {
namespace {

constexpr double kPi = std::numbers::pi;
std::size_t index(int i) { return static_cast<std::size_t>(i); }

// ---------------------------------------------------------------- frames along the path

struct Station {
  Vec3 center;
  Vec3 e1, e2;  // e1 x e2 = tangent
  double radius;

  // The body's own plane coordinates: angles grow clockwise about the tangent.
  Vec2 local(const Vec3& p) const {
    return Vec2((p - center).dot(e1), -(p - center).dot(e2)) / radius;
  }
  Vec3 world(const Vec2& q) const { return center + radius * (q.x() * e1 - q.y() * e2); }
};

Vec3 any_orthogonal(const Vec3& t) {
  Eigen::Index axis = 0;
  t.cwiseAbs().minCoeff(&axis);
  return t.cross(Vec3::Unit(axis)).normalized();
}

Vec3 reflect(const Vec3& x, const Vec3& v) {
  const double c = v.squaredNorm();
  return c > 0 ? Vec3(x - (2 * v.dot(x) / c) * v) : x;
}

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

// ---------------------------------------------------------------- strips and their shapes

// Seam points as fractions of a turn, a common refinement of the arcs of both ends; `shift` arcs of
// the end are passed before its first strip.
std::vector<BodyStrip> make_strips(int start_arcs, int end_arcs, int start_shift, int end_shift) {
  const int both = std::lcm(start_arcs, end_arcs);
  std::vector<int> breaks;
  for (int i = 0; i <= start_arcs; ++i) breaks.push_back(i * (both / start_arcs));
  for (int i = 0; i <= end_arcs; ++i) breaks.push_back(i * (both / end_arcs));
  std::sort(breaks.begin(), breaks.end());
  breaks.erase(std::unique(breaks.begin(), breaks.end()), breaks.end());
  const auto part = [&](int from, int to, int arcs, int shift) {
    const int width = both / arcs;
    const int arc = from / width;
    return ArcPart{(arc + shift) % arcs, static_cast<double>(from - arc * width) / width,
                   static_cast<double>(to - arc * width) / width};
  };
  std::vector<BodyStrip> strips;
  for (std::size_t k = 0; k + 1 < breaks.size(); ++k) {
    strips.push_back({part(breaks[k], breaks[k + 1], start_arcs, start_shift),
                      part(breaks[k], breaks[k + 1], end_arcs, end_shift)});
  }
  return strips;
}

// One end of one strip in its plane: what is blended between the ends.
struct StripShape {
  double share = 0;                        // of the turn: the strip's width in the common parameter
  double seam_angle = 0, seam_radius = 1;  // of the first point
  Vec2 seam_speed = Vec2::Zero();          // radial, tangential derivative in the common parameter
  std::array<double, 2> angle{}, radius{};  // of the two middle control points
};

using RingShape = std::vector<StripShape>;

double angle_of(const Vec2& p) { return std::atan2(p.y(), p.x()); }

// The angle nearest to `near`.
double unwrapped(double angle, double near) {
  return angle + 2 * kPi * std::round((near - angle) / (2 * kPi));
}

RingShape ring_shape(const std::vector<BodyStrip>& strips, const BodyEnd& end,
                     const Station& station, bool at_start) {
  RingShape shape;
  double angle = 0;
  for (const BodyStrip& strip : strips) {
    const ArcPart& part = at_start ? strip.start : strip.end;
    const Arc arc = end.arcs[index(part.arc)] * arc_part_weights(part.from, part.to).transpose();
    std::array<Vec2, 6> p;
    for (int j = 0; j < 6; ++j) p[index(j)] = station.local(arc.col(j));
    StripShape s;
    s.share = (part.to - part.from) / static_cast<double>(end.arcs.size());
    // Angles grow along the ring; a strip is less than a whole turn.
    double raw = unwrapped(angle_of(p[0]), angle);
    if (!shape.empty() && raw < angle) raw += 2 * kPi;
    s.seam_angle = shape.empty() ? angle_of(p[0]) : raw;
    s.seam_radius = p[0].norm();
    const Vec2 radial = p[0] / s.seam_radius;
    const Vec2 speed = 5 * (p[1] - p[0]) / s.share;
    s.seam_speed = Vec2(radial.dot(speed), -radial.y() * speed.x() + radial.x() * speed.y());
    angle = s.seam_angle;
    for (int j = 0; j < 2; ++j) {
      double a = unwrapped(angle_of(p[index(2 + j)]), angle);
      if (a < angle) a += 2 * kPi;
      s.angle[index(j)] = angle = a;
      s.radius[index(j)] = p[index(2 + j)].norm();
    }
    shape.push_back(s);
  }
  return shape;
}

// Adds one angle to the whole ring.
void turn(RingShape& shape, double angle) {
  for (StripShape& s : shape) {
    s.seam_angle += angle;
    for (double& a : s.angle) a += angle;
  }
}

// Largest seam turn between two rings after removing whole turns.
double match_turns(const RingShape& start, RingShape& end) {
  double mean = 0;
  for (std::size_t k = 0; k < start.size(); ++k) mean += end[k].seam_angle - start[k].seam_angle;
  mean /= static_cast<double>(start.size());
  turn(end, -2 * kPi * std::round(mean / (2 * kPi)));
  double largest = 0;
  for (std::size_t k = 0; k < start.size(); ++k) {
    largest = std::max(largest, std::abs(end[k].seam_angle - start[k].seam_angle));
  }
  return largest;
}

double mix(double a, double b, double w) { return (1 - w) * a + w * b; }

// The ring's control points between two shapes. Across a seam both neighbours take their tangents
// from one vector, times their own shares: the ratio is the same everywhere along the body.
std::vector<Vec2> blend(const RingShape& a, const RingShape& b, double w) {
  const std::size_t n = a.size();
  std::vector<Vec2> ring(5 * n);
  for (std::size_t k = 0; k < n; ++k) {
    const StripShape& p = a[k];
    const StripShape& q = b[k];
    const double angle = mix(p.seam_angle, q.seam_angle, w);
    const Vec2 radial(std::cos(angle), std::sin(angle));
    const Vec2 seam = mix(p.seam_radius, q.seam_radius, w) * radial;
    const Vec2 speed = mix(p.seam_speed.x(), q.seam_speed.x(), w) * radial +
                       mix(p.seam_speed.y(), q.seam_speed.y(), w) * Vec2(-radial.y(), radial.x());
    ring[5 * k] = seam;
    ring[5 * k + 1] = seam + p.share / 5 * speed;
    ring[(5 * k + 5 * n - 1) % (5 * n)] = seam - a[(k + n - 1) % n].share / 5 * speed;
    for (std::size_t j = 0; j < 2; ++j) {
      const double middle = mix(p.angle[j], q.angle[j], w);
      ring[5 * k + 2 + j] =
          mix(p.radius[j], q.radius[j], w) * Vec2(std::cos(middle), std::sin(middle));
    }
  }
  return ring;
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
    const std::vector<Vec2> ring = blend(start, end, smooth_step(t));
    for (std::size_t c = 0; c < ring.size(); ++c) {
      sweep.values.row(i).segment<3>(static_cast<Eigen::Index>(3 * c)) = station.world(ring[c]);
    }
    sweep.parameters.push_back(t);
    sweep.radii.push_back(station.radius);
  }
  return sweep;
}

// Ring of an end, exactly on its arcs.
Eigen::RowVectorXd end_row(const std::vector<BodyStrip>& strips, const BodyEnd& end,
                           bool at_start) {
  Eigen::RowVectorXd row(static_cast<Eigen::Index>(15 * strips.size()));
  for (std::size_t k = 0; k < strips.size(); ++k) {
    const ArcPart& part = at_start ? strips[k].start : strips[k].end;
    const Arc arc = end.arcs[index(part.arc)] * arc_part_weights(part.from, part.to).transpose();
    for (int j = 0; j < 5; ++j) {
      row.segment<3>(static_cast<Eigen::Index>(15 * k) + 3 * j) = arc.col(j);
    }
  }
  return row;
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
    if (worst[s] > tolerance && width * static_cast<double>(stations) >= 8) {
      finer.push_back(breaks[s] + width / 2);
    }
    finer.push_back(breaks[s + 1]);
  }
  return finer;
}

// Least (Su x Sv) . outward over its mean, on a grid of every strip.
double jacobian_ratio(const Body& body, const BSplineCurve<4>& path) {
  const int steps = 4;
  const KnotVector bezier = KnotVector::bezier(5);
  const std::vector<double> breaks = body.u.breakpoints();
  double least = std::numeric_limits<double>::infinity();
  double sum = 0;
  int count = 0;
  for (std::size_t s = 0; s + 1 < breaks.size(); ++s) {
    for (int a = 0; a <= steps; ++a) {
      const double u = breaks[s] + (breaks[s + 1] - breaks[s]) * a / steps;
      const BasisValues bu = basis_at(body.u, u, 1);
      Points3 row = Points3::Zero(3, body.ring() + 1);
      Points3 row_u = row;
      for (int i = 0; i < body.u.order(); ++i) {
        const auto ring = body.net.middleCols((bu.first + i) * body.ring(), body.ring());
        row.leftCols(body.ring()) += bu.values(0, i) * ring;
        row_u.leftCols(body.ring()) += bu.values(1, i) * ring;
      }
      row.rightCols<1>() = row.col(0);
      row_u.rightCols<1>() = row_u.col(0);
      const Vec3 center = path.at(u).head<3>();
      for (std::size_t k = 0; k < body.strips.size(); ++k) {
        for (const double v : {0.0, 0.25, 0.5, 0.75}) {
          const BasisValues bv = basis_at(bezier, v, 1);
          const auto first = static_cast<Eigen::Index>(5 * k);
          const Vec3 p = row.middleCols<6>(first) * bv.values.row(0).transpose();
          const Vec3 pv = row.middleCols<6>(first) * bv.values.row(1).transpose();
          const Vec3 pu = row_u.middleCols<6>(first) * bv.values.row(0).transpose();
          const double area = pu.cross(pv).dot((p - center).normalized());
          least = std::min(least, area);
          sum += area;
          ++count;
        }
      }
    }
  }
  return sum > 0 ? least / (sum / count) : -1.0;
}

struct Matching {
  std::vector<BodyStrip> strips;
  RingShape start, end;
  double twist_rad;
};

// The pair of seams that, laid on each other, turn least along the body.
Matching match_seams(const BodyEnd& start, const BodyEnd& end, const Station& first,
                     const Station& last) {
  const int a = static_cast<int>(start.arcs.size());
  const int b = static_cast<int>(end.arcs.size());
  Matching best;
  best.twist_rad = std::numeric_limits<double>::infinity();
  for (int i = 0; i < a; ++i) {
    for (int j = 0; j < b; ++j) {
      Matching trial;
      trial.strips = make_strips(a, b, i, j);
      trial.start = ring_shape(trial.strips, start, first, true);
      trial.end = ring_shape(trial.strips, end, last, false);
      trial.twist_rad = match_turns(trial.start, trial.end);
      if (trial.twist_rad < best.twist_rad - 1e-9) best = std::move(trial);
    }
  }
  return best;
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
    const Vec3 offset = radius * (along[index(j)] * seam + side[index(j)] * across);
    arcs[0].col(j) = center + offset;
    arcs[1].col(j) = center - offset;
  }
  return arcs;
}

Eigen::Matrix<double, 6, 6> arc_part_weights(double from, double to) {
  // Row i: the blossom with 5 - i arguments `from` and i arguments `to`, by de Casteljau on the
  // unit vectors of the control points.
  Eigen::Matrix<double, 6, 6> weights;
  for (int i = 0; i < 6; ++i) {
    Eigen::Matrix<double, 6, 6> points = Eigen::Matrix<double, 6, 6>::Identity();  // row: a point
    for (int level = 0; level < 5; ++level) {
      const double t = level < 5 - i ? from : to;
      for (int j = 0; j < 5 - level; ++j) {
        points.row(j) = (1 - t) * points.row(j) + t * points.row(j + 1);
      }
    }
    weights.row(i) = points.row(0);
  }
  return weights;
}

Body make_body(const BodyPath& path, BodyEnd start, BodyEnd end, const BodyOptions& options) {
  EXPECTS(options.tolerance > 0);
  const int spans = static_cast<int>(path.curve.knots().breakpoints().size()) - 1;
  const int count = std::max(24, 4 * spans);
  if (start.tangent.isZero()) start = free_end(path.curve, 0.0);
  if (end.tangent.isZero()) end = free_end(path.curve, 1.0);
  const std::vector<Station> stations = stations_along(path.curve, start, end, count);
  const Station& first = stations.front();
  const Station& last = stations.back();
  if (start.arcs.empty() && end.arcs.empty()) {
    start.arcs = two_arc_circle(first.center, first.radius, start.tangent, first.e1);
  }
  if (start.arcs.empty()) start.arcs = carried_arcs(end.arcs, last, first);
  if (end.arcs.empty()) end.arcs = carried_arcs(start.arcs, first, last);

  const Matching match = match_seams(start, end, first, last);
  const Sweep sweep = sweep_rings(stations, match.start, match.end);
  Body body;
  body.strips = match.strips;
  body.twist_rad = match.twist_rad;

  SplineFitProblem problem;
  problem.parameters = sweep.parameters;
  problem.values = sweep.values;
  const Eigen::RowVectorXd first_row = end_row(match.strips, start, true);
  const Eigen::RowVectorXd last_row = end_row(match.strips, end, false);
  const Departure leaving = departure_at(path.curve, 0.0, start);
  const Departure arriving = departure_at(path.curve, 1.0, end);
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
    std::vector<double> finer = bisected(breaks, worst, options.tolerance, stations.size());
    if (finer.size() == breaks.size()) break;
    breaks = std::move(finer);
  }
  body.net.resize(3, static_cast<Eigen::Index>(body.rows()) * body.ring());
  for (int i = 0; i < body.rows(); ++i) {
    for (int c = 0; c < body.ring(); ++c) {
      body.net.col(i * body.ring() + c) = control.row(i).segment<3>(3 * c).transpose();
    }
  }
  body.jacobian_ratio = jacobian_ratio(body, path.curve);
  return body;
}

}  // namespace angiospline
