#include "modeling/layout/start.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>

#include "base/index.h"
#include "modeling/layout/rules.h"

namespace angiospline {
namespace {

using namespace layout_rules;

constexpr double kTurn = 2 * std::numbers::pi;

}  // namespace

double wrapped_angle(double angle) { return angle - kTurn * std::round(angle / kTurn); }

std::vector<double> bounded_seams(const std::vector<double>& wanted) {
  const std::size_t count = wanted.size();
  const double share = kTurn / static_cast<double>(count);
  const double least = count == 2 ? share : kLeastSector * share;
  const double most = count == 2 ? share : std::min(kMostSector * share, std::numbers::pi);
  std::vector<double> sector(count);
  for (std::size_t k = 0; k < count; ++k) {
    const double angle = wrapped_angle(wanted[(k + 1) % count] - wanted[k]);
    sector[k] = angle > 0 ? angle : angle + kTurn;
  }

  // Alternating projections: onto the sectors that are allowed, then onto those that make a turn.
  for (int pass = 0; pass < kSeamPasses; ++pass) {
    double sum = 0;
    for (double& s : sector) sum += s = std::clamp(s, least, most);
    for (double& s : sector) s += (kTurn - sum) / static_cast<double>(count);
  }

  // All turned alike, so that they lie nearest to what was wanted: the mean on the circle.
  std::vector<double> seams(count, 0.0);
  for (std::size_t k = 1; k < count; ++k) seams[k] = seams[k - 1] + sector[k - 1];
  double sine = 0;
  double cosine = 0;
  for (std::size_t k = 0; k < count; ++k) {
    sine += std::sin(wanted[k] - seams[k]);
    cosine += std::cos(wanted[k] - seams[k]);
  }
  const double turn = std::atan2(sine, cosine);
  for (double& s : seams) s += turn;
  return seams;
}

double opening_azimuth(const OpeningFrame& frame, const Vec3& x) {
  const Vec3 arm = x - frame.center;
  return std::atan2(frame.y.dot(arm), frame.x.dot(arm));
}

namespace {

std::vector<OpeningFrame> start_openings(const JunctionTopology& topology,
                                         const JunctionTarget& target,
                                         const std::vector<Vec3>& poles,
                                         const std::vector<double>& distances) {
  std::vector<OpeningFrame> frames;
  for (std::size_t b = 0; b < topology.sectors.size(); ++b) {
    const TargetBranch& branch = target.branches()[b];
    OpeningFrame frame;
    frame.axis = branch.direction;
    frame.center = branch.start + distances[b] * branch.direction;
    frame.radius = branch.radius;

    // Far enough out that a branch beside the centre sees it on the right side.
    const double reach = branch.radius + branch.start.norm();
    const auto pole = [&](int patch) -> Vec3 {
      return reach * poles[index(topology.patches[index(patch)].from)];
    };
    const Vec3 first = pole(topology.sectors[b].front()) - frame.center;
    const Vec3 across = first - first.dot(frame.axis) * frame.axis;
    frame.x = across.norm() > 1e-6 * reach ? across.normalized() : frame.axis.unitOrthogonal();
    frame.y = frame.axis.cross(frame.x);

    std::vector<double> wanted;
    for (const int patch : topology.sectors[b])
      wanted.push_back(opening_azimuth(frame, pole(patch)));
    frame.seams_rad = bounded_seams(wanted);
    frames.push_back(std::move(frame));
  }
  return frames;
}

// The ray from the origin to a branch's opening, with its length.
TargetBranch seen_from_origin(const JunctionTarget& target, int branch,
                              const std::vector<double>& distances) {
  TargetBranch seen = target.branches()[index(branch)];
  seen.length = distances[index(branch)];
  if (seen.start.isZero(0)) return seen;
  const Vec3 opening = seen.start + seen.length * seen.direction;
  seen.length = opening.norm();
  seen.direction = opening / seen.length;
  seen.start.setZero();
  return seen;
}

// The crotch of two cylinders lies at the angle beta from a with r_a / sin(beta) = r_b / sin(angle
// - beta); a saddle that does not pass between its branches crosses in the middle of its Voronoi
// arc.
SaddleCrossing crossing(const JunctionTopology& topology, const JunctionTarget& target,
                        const JunctionSaddle& saddle, const std::vector<double>& distances) {
  const TargetBranch a = seen_from_origin(target, saddle.branch_a, distances);
  const TargetBranch b = seen_from_origin(target, saddle.branch_b, distances);

  // The arc of the Voronoi diagram between the saddle's poles, and where the plane halfway between
  // the branches meets it.
  const Vec3& from = topology.poles[index(saddle.from)].direction;
  const Vec3& to = topology.poles[index(saddle.to)].direction;
  const Vec3 edge = (b.direction - a.direction).normalized();
  const Vec3 side = -edge.cross(from);  // the arc turns from `from` towards it
  const double arc = std::acos(std::clamp(from.dot(to), -1.0, 1.0));
  const Vec3 sum = a.direction + b.direction;
  const double angle = std::acos(std::clamp(a.direction.dot(b.direction), -1.0, 1.0));
  const double turn = std::atan2(side.dot(sum), from.dot(sum));
  const double nearest = std::min(a.length, b.length);

  // The law of sines in the triangle of centre, crotch and foot gives beta.
  if (sum.norm() > 0.5 && turn > 0 && turn < arc) {
    const double raw =
        std::atan2(a.radius * std::sin(angle), b.radius + a.radius * std::cos(angle));
    // The more the branches are opposed, the nearer to the middle between them.
    const double keep =
        angle < std::numbers::pi / 2 ? 0.05 : 0.05 + 0.8 * (angle / std::numbers::pi - 0.5);
    const double beta = std::clamp(raw, keep * angle, (1 - keep) * angle);

    const Vec3 across = (b.direction - std::cos(angle) * a.direction).normalized();
    const double distance = (a.radius + b.radius) / (2 * std::sin(angle / 2));
    return {std::cos(beta) * a.direction + std::sin(beta) * across, std::min(distance, nearest)};
  }

  const Vec3 middle = std::cos(arc / 2) * from + std::sin(arc / 2) * side;
  return {middle, std::min(a.radius, b.radius)};
}

// A pole starts above the mean of the crossings around it.
std::vector<Vec3> start_poles(const JunctionTopology& topology, const JunctionTarget& target,
                              const std::vector<SaddleCrossing>& crossings) {
  std::vector<Vec3> sums(topology.poles.size(), Vec3::Zero());
  std::vector<double> lifts(topology.poles.size(), 0.0);
  for (std::size_t s = 0; s < crossings.size(); ++s) {
    const JunctionSaddle& saddle = topology.saddles[s];
    for (const int pole : {saddle.from, saddle.to}) {
      const double count = static_cast<double>(topology.poles[index(pole)].branches.size());
      sums[index(pole)] += crossings[s].distance * crossings[s].direction / count;
      lifts[index(pole)] += (target.branches()[index(saddle.branch_a)].radius +
                             target.branches()[index(saddle.branch_b)].radius) /
                            (2 * count);
    }
  }

  std::vector<Vec3> directions;
  for (std::size_t k = 0; k < sums.size(); ++k) {
    const Vec3& n = topology.poles[k].direction;
    const double up = n.dot(sums[k]);
    const Vec3 along = sums[k] - up * n;
    // A pole on the far side of branches that lean away from it stays there.
    const double share = std::clamp(1 + 2 * up / lifts[k], 0.0, 1.0);
    directions.push_back((share * along + std::max(up, lifts[k]) * n).normalized());
  }
  return directions;
}

}  // namespace

LayoutStart layout_start(const JunctionTopology& topology, const JunctionTarget& target,
                         const std::vector<double>& distances) {
  LayoutStart start;
  for (const JunctionSaddle& saddle : topology.saddles) {
    start.crossings.push_back(crossing(topology, target, saddle, distances));
  }
  start.poles = start_poles(topology, target, start.crossings);
  start.openings = start_openings(topology, target, start.poles, distances);
  return start;
}

}  // namespace angiospline
