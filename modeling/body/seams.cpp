#include "modeling/body/seams.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "base/index.h"

namespace angiospline {
namespace {

constexpr double kPi = std::numbers::pi;

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
    // Less than half a turn lies between control points of a strip: the nearest angle is meant.
    s.seam_angle = shape.empty() ? angle_of(p[0]) : unwrapped(angle_of(p[0]), angle);
    s.seam_radius = p[0].norm();
    const Vec2 radial = p[0] / s.seam_radius;
    const Vec2 speed = 5 * (p[1] - p[0]) / s.share;
    s.seam_speed = Vec2(radial.dot(speed), -radial.y() * speed.x() + radial.x() * speed.y());

    // The two control points in the middle, each the nearest way round from the one before.
    angle = s.seam_angle;
    for (int j = 0; j < 2; ++j) {
      s.angle[index(j)] = angle = unwrapped(angle_of(p[index(2 + j)]), angle);
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

}  // namespace

std::vector<Vec2> blend_rings(const RingShape& a, const RingShape& b, double w) {
  const std::size_t n = a.size();
  std::vector<Vec2> ring(5 * n);
  for (std::size_t k = 0; k < n; ++k) {
    const StripShape& p = a[k];
    const StripShape& q = b[k];

    // The seam and the vector along the ring there, in polar coordinates, so that the ring stays
    // round while it turns.
    const double angle = mix(p.seam_angle, q.seam_angle, w);
    const Vec2 radial(std::cos(angle), std::sin(angle));
    const Vec2 seam = mix(p.seam_radius, q.seam_radius, w) * radial;
    const Vec2 speed = mix(p.seam_speed.x(), q.seam_speed.x(), w) * radial +
                       mix(p.seam_speed.y(), q.seam_speed.y(), w) * Vec2(-radial.y(), radial.x());

    // Its neighbours lie on both sides along that one vector: this keeps the ratio.
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

SeamMatching match_seams(const BodyEnd& start, const BodyEnd& end, const Station& first,
                         const Station& last) {
  const int a = static_cast<int>(start.arcs.size());
  const int b = static_cast<int>(end.arcs.size());

  // Every pair is tried: there are few arcs, and a tie goes to the first.
  SeamMatching best;
  best.twist_rad = std::numeric_limits<double>::infinity();
  for (int i = 0; i < a; ++i) {
    for (int j = 0; j < b; ++j) {
      SeamMatching trial;
      trial.strips = make_strips(a, b, i, j);
      trial.start = ring_shape(trial.strips, start, first, true);
      trial.end = ring_shape(trial.strips, end, last, false);
      trial.twist_rad = match_turns(trial.start, trial.end);
      if (trial.twist_rad < best.twist_rad - 1e-9) best = std::move(trial);
    }
  }
  return best;
}

Points3 ring_on_arcs(const std::vector<BodyStrip>& strips, const BodyEnd& end, bool at_start) {
  Points3 ring(3, static_cast<Eigen::Index>(5 * strips.size()));
  for (std::size_t k = 0; k < strips.size(); ++k) {
    const ArcPart& part = at_start ? strips[k].start : strips[k].end;
    const Arc arc = end.arcs[index(part.arc)] * arc_part_weights(part.from, part.to).transpose();
    ring.middleCols<5>(static_cast<Eigen::Index>(5 * k)) = arc.leftCols<5>();
  }
  return ring;
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

}  // namespace angiospline
